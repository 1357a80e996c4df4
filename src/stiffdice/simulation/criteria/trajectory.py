"""`trajectory`: the cube is where a reference run says, until a horizon. Distances are in radii of the cube."""

from __future__ import annotations

import math
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.reference import distance
from stiffdice.simulation.task import System

MEASURE = "trajectory_error"
LONG_NAME = "largest distance from the reference before the horizon, in radii of the cube"
MEANING = "within tolerance radii of the reference until the horizon"
BASE, TOLERANCE = 0.0, 0.05
FAILURE = Verdict.OFF_TRAJECTORY
BY_DEFAULT, FOR_TURNING = False, True
SLOTS = 1  # the measure


@njit
def observe(slots: Any, sight: Any, system: System, state: Any, reference: Any) -> tuple[float, bool]:
    """Return the measure so far, and whether nothing can change it any more."""
    if reference.horizon < 0.0:
        slots[0] = math.nan
        return slots[0], False
    if sight.time > reference.horizon:
        return slots[0], True
    slots[0] = max(slots[0], distance(reference, sight.time, state) / system.physics.radius)
    return slots[0], False
