"""The pips of a die: which face has which number. Opposite faces sum to seven; 1, 2, 3 turn counterclockwise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# Outward normals along the edges of the upright die, shape (face, axis), of the faces 1 to 6 in this order.
NORMALS = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0], [0, -1, 0], [-1, 0, 0], [0, 0, -1]], dtype=np.float64)
FACES = tuple(range(1, len(NORMALS) + 1))


def opposite(face: int) -> int:
    """Return the face on the other side of a face."""
    return len(NORMALS) + 1 - face


def rest_heights(half_sides: Array, centre: Array) -> Array:
    """Return how high the centre of mass is over each face that lies on the ground [m], shape (face,).

    half_sides [m]: of the box, shape (3,). centre [m]: its centre of mass from that of the box, along the edges.
    """
    return np.asarray(np.abs(NORMALS) @ half_sides - NORMALS @ centre)


def tipping_heights(half_sides: Array, centre: Array) -> Array:
    """Return how high the centre of mass must come to tip off each face, over its nearest edge [m], shape (face,).

    Of a body on one face the centre of mass rises until it is right above an edge. An edge is where two faces meet, so
    that its distance from the centre of mass follows from theirs.
    """
    rest = rest_heights(half_sides, centre)
    neighbours = NORMALS @ NORMALS.T == 0
    return np.asarray(np.hypot(rest, np.where(neighbours, rest, np.inf).min(axis=1)))


def face_below(directions: Array, rest: Array) -> npt.NDArray[np.intp]:
    """Return the face that a body would come to lie on if it moved slowly, for directions to the ground.

    It is the face that a ray down from the centre of mass leaves through: the valleys of the centre's height are parted
    by planes through the centre of mass and the edges. directions: down, along the edges, shape (..., 3). rest [m]: as
    of `rest_heights`.
    """
    return np.asarray((directions @ NORMALS.T / rest).argmax(axis=-1) + 1)


# A die over a table, as a scene's plain data; that of `config/scenes/die.yaml`.
SCENE: Mapping[str, Any] = {
    "cube": {"side": "16 mm", "mass": "5 g"},
    "ground": {"restitution": 0.5, "contact_time": "1 ms", "friction": 0.2},
    "launch": {"position": "[0, 0, 10] cm", "velocity": "[1, 0, 0] m/s", "node_velocity": "rigid"},
    "gravity": 9.81,
    "duration": 2.0,
}
