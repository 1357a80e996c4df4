"""The pips of a die: which face has which number. Opposite faces sum to seven; 1, 2, 3 turn counterclockwise."""

from __future__ import annotations

import numpy as np

# Outward normals along the edges of the upright die, shape (face, axis), of the faces 1 to 6 in this order.
NORMALS = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0], [0, -1, 0], [-1, 0, 0], [0, 0, -1]], dtype=np.float64)
FACES = tuple(range(1, len(NORMALS) + 1))


def opposite(face: int) -> int:
    """Return the face on the other side of a face."""
    return len(NORMALS) + 1 - face
