"""Rotations by a rotation vector, and components of vectors."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def along(vectors: Array, direction: Sequence[float] | Array) -> Array:
    """Return the components of vectors, shape (..., 3), in a direction; BLAS has other digits on other processors."""
    x, y, z = direction
    return np.asarray(vectors[..., 0] * x + vectors[..., 1] * y + vectors[..., 2] * z)


def rotated(offsets: Array, rotation: Array) -> Array:
    """Return offsets, shape (node, 3), turned by a rotation vector [rad] (Rodrigues' formula, equation 9)."""
    angle = math.hypot(*rotation)
    if angle == 0:
        return offsets.copy()
    axis = rotation / angle
    parallel = np.outer(along(offsets, axis), axis)
    return np.asarray(parallel + math.cos(angle) * (offsets - parallel) + math.sin(angle) * np.cross(axis, offsets))


def matrices(quaternions: Array) -> Array:
    """Return rotation matrices, shape (K, 3, 3), of unit quaternions (w, x, y, z), shape (K, 4)."""
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
