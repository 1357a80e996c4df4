"""`restitution`: each bounce gives back what the contact law, solved exactly, gives back.

For flat landings only, four nodes at once: there the law is known exactly (`exact.py`). A bounce counts if the cube
fell from at least ten times its sag at rest; below, it is settling, and its weight matters as much as the blow.
"""

from __future__ import annotations

import math
from typing import Any

from stiffdice import exact
from stiffdice.compiled import njit
from stiffdice.contact import lowest_of
from stiffdice.state import Physics
from stiffdice.verdict import Verdict
from stiffdice.watch import settled

MEASURE = "restitution_error"
LONG_NAME = "largest difference of a bounce's restitution from the contact law's, over the flat landings"
MEANING = "each flat bounce's e within tolerance of the exact one of its contact law"
BASE, TOLERANCE = 0.0, 0.05
FAILURE = Verdict.RESTITUTION_OFF
BY_DEFAULT, FOR_TURNING = False, False
SLOTS = 1  # the measure


@njit
def start(slots: Any, sight: Any, physics: Physics, state: Any) -> None:
    """Begin to watch a run that stands at its launch."""
    slots[0] = 0.0


@njit
def observe(slots: Any, sight: Any, law: Any, physics: Physics, state: Any, reference: Any) -> tuple[float, bool]:
    """Return the measure so far, and whether nothing can change it any more; not-a-number after any other landing."""
    blow = sight.speed_in * sight.speed_in / 2
    if sight.lifted > 0.0 and blow > 0.0 and blow >= settled(sight) and sight.pull >= 0.0 and physics.stiffness > 0.0:
        free = _free_depth(physics, state)
        # An undamped cube goes deepest: its sag twice, and v/ω.
        depth = 2 * sight.sag + sight.speed_in * math.sqrt(physics.mass / 4 / physics.stiffness)
        if depth < free and not math.isnan(slots[0]):
            out = exact.rebound_speed(law, physics, sight.pull, sight.speed_in)
            slots[0] = max(slots[0], abs(sight.speed_out - out) / sight.speed_in)
        elif free == 0.0:
            slots[0] = math.nan
    return slots[0], False


@njit
def _free_depth(physics: Physics, state: Any) -> float:
    """Return how much higher than the four lowest nodes the others are [m]; 0 if those are not at one height."""
    lowest = -lowest_of(physics, state)
    flat = 1e-9 * physics.reach
    touching, others = 0, math.inf
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        above = physics.nx * nodes[k, 0] + physics.ny * nodes[k, 1] + physics.nz * nodes[k, 2] - lowest
        if above <= flat:
            touching += 1
        else:
            others = min(others, above)
    return others if touching == 4 else 0.0
