"""What a run of two boxes in any engine tells, and where the boxes start."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.state import Array
from stiffdice.scene.pair import PairScene
from stiffdice.scene.rotation import matrices
from stiffdice.scene.scene import Scene


class Motion(NamedTuple):
    """Velocities [m/s] and spins [rad/s] of two boxes, shape (2, 3); of spins, along any axes."""

    velocity: Array
    spin: Array


class Push(NamedTuple):
    """What one box does to the other: force [N], torque about its centre [N m], and at how many contacts."""

    force: Array
    torque: Array
    contacts: int


class Rest(NamedTuple):
    """After each step: how many contacts two boxes have, and how high the upper one's centre is [m]."""

    contacts: npt.NDArray[np.int64]
    height: Array


def kinetic_of(scene: PairScene, motion: Motion) -> float:
    """Return the kinetic energy of two cubes [J]."""
    parts = zip(scene.cubes, motion.velocity, motion.spin, strict=True)
    with np.errstate(over="ignore", invalid="ignore"):  # a run that blew up
        return sum(0.5 * (c.mass * float(v @ v) + c.moment_of_inertia * float(w @ w)) for c, v, w in parts)


def launched(scene: PairScene) -> Motion:
    """Return how boxes that do not spin are launched."""
    return Motion(np.array([part.launch.velocity for part in scene.parts]), np.zeros((2, 3)))


def pose_of(part: Scene) -> tuple[Array, Array]:
    """Return the centre of a box at its launch [m], and its turn as a unit quaternion (w, x, y, z)."""
    vector = np.array(part.launch.orientation)
    half = math.hypot(*vector) / 2
    share = 0.5 if half == 0 else math.sin(half) / (2 * half)
    return np.array(part.launch.position), np.array([math.cos(half), *(share * vector)])


def overlap_of(scene: PairScene) -> float:
    """Return the least way [m] by which two boxes have to be moved apart; not above zero where they are apart.

    By the separating axes of two boxes: the normals of faces, and the common normals of edges.
    """
    (first, p), (second, q) = (pose_of(part) for part in scene.parts)
    axes = [turn.T for turn in matrices(np.array([p, q]))]
    half = [np.array(cube.half_sides) for cube in scene.cubes]
    crossed = [np.cross(a, b) for a, b in itertools.product(*axes)]
    ways = []
    for axis in (*axes[0], *axes[1], *crossed):
        length = float(np.linalg.norm(axis))
        if length > 1e-6:  # parallel edges have a common normal among the faces'
            reach = sum(float(np.abs(edges @ axis) @ size) for edges, size in zip(axes, half, strict=True))
            ways.append((reach - abs(float((second - first) @ axis))) / length)
    return min(ways)
