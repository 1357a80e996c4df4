"""From an engine's quaternions to a state's nodes."""

from __future__ import annotations

import numpy as np

from stiffdice.state import Array


def matrices(quaternions: Array) -> Array:
    """Return rotation matrices, shape (K, 3, 3), of unit quaternions (w, x, y, z), shape (K, 4)."""
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def turned(rotations: Array, nodes: Array) -> Array:
    """Return nodes, shape (8, 3), as each of the rotations, shape (K, 3, 3), turns them: shape (K, 8, 3)."""
    return np.asarray(nodes @ np.swapaxes(rotations, 1, 2))
