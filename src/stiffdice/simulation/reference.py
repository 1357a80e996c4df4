"""What a run is compared with: the same launch on the same ground, computed finely, in one table.

A reference is the scene's own launch by the scheme `event`, at a tolerance whose error does not matter
(`reference_run`). Member k of an ensemble enters the same flight a little late; it is compared at the time since the
scene's launch.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.compilation import njit

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
