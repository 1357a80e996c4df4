"""What a kernel works on where two boxes move: their states, and the physics they move in."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.state import STATE, Physics, physics_of, start_of
from stiffdice.dynamics.vector import Vector, minus, norm, vector
from stiffdice.scene.pair import PairScene

# Two rigid bodies. One record is one state of both. depth [m]: of the deepest contact between them when their forces
# were evaluated last.
PAIR = np.dtype([("a", STATE), ("b", STATE), ("depth", np.float64)])
Pairs = npt.NDArray[np.void]  # of PAIR


class PairPhysics(NamedTuple):
    """The numbers of a scene of two boxes: those of each on the ground, half of its sides [m]; and of their contact.

    stiffness [kg/s²], damping [kg/s] and friction [1] of a node of one in a face of the other: those of the ground.
    cutoff [m/s]: of regularised friction.
    """

    a: Physics
    b: Physics
    half_a: Vector
    half_b: Vector
    stiffness: float
    damping: float
    friction: float
    cutoff: float


def pair_physics_of(scene: PairScene) -> PairPhysics:
    """Return the scene's numbers as a kernel takes them."""
    a, b = (physics_of(part) for part in scene.parts)
    half_a, half_b = (Vector(*cube.half_sides) for cube in scene.cubes)
    return PairPhysics(a, b, half_a, half_b, a.stiffness, a.damping, a.friction, min(a.cutoff, b.cutoff))


def pair_start_of(scene: PairScene) -> Pairs:
    """Return the state of both boxes at the launch, shape (1,)."""
    state = np.zeros(1, PAIR)
    for name, part in zip(("a", "b"), scene.parts, strict=True):
        state[name] = start_of(part, "tumbling")
    return state


@njit
def are_near(physics: PairPhysics, pair: Any) -> bool:
    """Return whether the spheres around the two boxes meet."""
    apart = norm(minus(vector(pair.a.position), vector(pair.b.position)))
    return bool(apart <= physics.a.reach + physics.b.reach)
