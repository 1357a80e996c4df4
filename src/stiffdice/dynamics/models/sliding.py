"""`sliding`: translation only, the paper's ground_cube.m. The cube keeps the orientation it starts with."""

from __future__ import annotations

from collections import namedtuple
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import Wrench, height_of, node_force, reaches, upward
from stiffdice.dynamics.state import Physics
from stiffdice.dynamics.vector import Vector, plus, row, vector

Sliding = namedtuple("Sliding", ())
TAG = Sliding()


@njit
def force(physics: Physics, state: Any) -> Wrench:
    """Return the total force on the cube [N]; its torque is left out."""
    if not reaches(physics, height_of(physics, state) - physics.reach):
        return 0.0, 0.0, -physics.weight, 0.0, 0.0, 0.0
    place, velocity, total = vector(state.position), vector(state.velocity), Vector(0.0, 0.0, 0.0)
    for k in range(len(state.node_offset)):
        depth = -upward(physics, plus(place, row(state.node_offset, k)))
        total = plus(total, node_force(physics, depth, velocity))
    return total.x, total.y, total.z, 0.0, 0.0, 0.0


@njit
def kick(physics: Physics, state: Any, wrench: Wrench, h: float) -> None:
    """Advance the velocity by h [s] under a force (equation 6)."""
    for axis in range(3):
        state.velocity[axis] += h * wrench[axis] / physics.mass


@njit
def drift(physics: Physics, state: Any, h: float) -> None:
    """Advance the position by h [s] at the state's velocity (equation 7)."""
    for axis in range(3):
        state.position[axis] += h * state.velocity[axis]
