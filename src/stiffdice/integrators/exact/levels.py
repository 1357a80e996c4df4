"""The heights at which the nodes of a cube that does not turn are, as springs that begin at up to eight levels."""

from __future__ import annotations

from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import upward
from stiffdice.dynamics.state import Array, Physics
from stiffdice.dynamics.vector import row

# Rows of the table of levels, lowest first: height above the lowest [m], how many nodes are on those below, and the sum
# of their heights [m].
HEIGHT, BELOW, SUM = range(3)

# Nodes whose levels differ by less, in units of the farthest node's distance, are level: rounding differs by as much.
_LEVEL = 2.0**-48


@njit
def fill(physics: Physics, state: Any, table: Array) -> tuple[int, float]:
    """Fill the table of levels; return how many there are, and the lowest's height above the centre [m]."""
    heights = table[HEIGHT]
    count = len(state.node_offset)
    for k in range(count):
        height = upward(physics, row(state.node_offset, k))
        place = k
        while place > 0 and heights[place - 1] > height:
            heights[place] = heights[place - 1]
            place -= 1
        heights[place] = height
    table[BELOW, 0] = table[SUM, 0] = 0.0
    levels, start, lowest = 0, 0, 0.0
    for k in range(1, count + 1):
        if k < count and heights[k] - heights[k - 1] <= _LEVEL * physics.reach:
            continue
        mean = 0.0
        for member in range(start, k):
            mean += (heights[member] - heights[start]) / (k - start)
        mean += heights[start]
        if levels == 0:
            lowest = mean
        heights[levels] = mean - lowest
        table[BELOW, levels + 1] = k
        table[SUM, levels + 1] = table[SUM, levels] + (k - start) * (mean - lowest)
        levels += 1
        start = k
    return levels, lowest
