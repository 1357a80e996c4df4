"""`trajectory`: the cube is where a reference run says, until a horizon. Distances are in radii of the cube.

A reference is the scene's own launch by the scheme `event`, at a tolerance whose error does not matter
(`reference_run`), in one table. Member k of an ensemble enters the same flight a little late; it is compared at the
time since the scene's launch.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.compilation import njit
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.task import System

MEASURE = "trajectory_error"
LONG_NAME = "largest distance from the reference before the horizon, in radii of the cube"
MEANING = "within tolerance radii of the reference until the horizon"
BASE, TOLERANCE = 0.0, 0.05
FAILURE = Verdict.OFF_TRAJECTORY
BY_DEFAULT, FOR_TURNING = False, True
SLOTS = 1  # the measure

SAMPLES = 2048

# horizon [s]: until when to compare, −1 for not at all; spacing [s] of the samples; position [m], velocity [m/s].
REFERENCE = np.dtype(
    [
        ("horizon", np.float64),
        ("spacing", np.float64),
        ("position", np.float64, (SAMPLES + 1, 3)),
        ("velocity", np.float64, (SAMPLES + 1, 3)),
    ]
)


def empty(count: int = 1, horizon: float = -1.0) -> npt.NDArray[np.void]:
    """Return references whose samples are to be filled, shape (count,), evenly spread from time 0 to horizon [s]."""
    references = np.zeros(count, REFERENCE)
    references["horizon"], references["spacing"] = horizon, horizon / SAMPLES
    return references


@njit
def distance(reference: Any, time: float, state: Any) -> float:
    """Return how far the state's place is from the reference's at a time [s] [m].

    Between samples the reference is the cubic through places and velocities (Hermite).
    """
    k = min(int(time / reference.spacing), SAMPLES - 1)
    s = time / reference.spacing - k
    total = 0.0
    for axis in range(3):
        p, q = reference.position[k, axis], reference.position[k + 1, axis]
        u, v = reference.velocity[k, axis] * reference.spacing, reference.velocity[k + 1, axis] * reference.spacing
        place = p + s * (u + s * (3 * (q - p) - 2 * u - v + s * (2 * (p - q) + u + v)))
        total += (state.position[axis] - place) ** 2
    return math.sqrt(total)


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
