"""`finite`: no number leaves the range of doubles."""

from __future__ import annotations

import math
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.task import System

MEASURE = "out_of_range"
LONG_NAME = "1 if a number left the range of doubles"
MEANING = "every number stays within the range of doubles"
BASE, TOLERANCE = 0.0, 0.0
FAILURE = Verdict.LEFT_NUMERIC_RANGE
BY_DEFAULT, FOR_TURNING = False, True
SLOTS = 1  # the measure


@njit
def observe(slots: Any, sight: Any, system: System, state: Any, reference: Any) -> tuple[float, bool]:
    """Return the measure so far, and whether nothing can change it any more."""
    total = 0.0
    for axis in range(3):
        total += abs(state.position[axis]) + abs(state.velocity[axis]) + abs(state.angular_momentum[axis])
        total += abs(state.node_offset[0, axis])  # a spin past range turns all nodes into not-a-number
    if not total < math.inf:
        slots[0] = 1.0
    return slots[0], False
