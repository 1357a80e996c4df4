"""`sliding`: translation only, the paper's ground_cube.m. The cube keeps the orientation it starts with."""

from __future__ import annotations

from typing import Any, NamedTuple

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import Wrench, height_of, node_force, reaches, upward
from stiffdice.dynamics.state import Physics


class Sliding(NamedTuple):
    """The tag of this model."""


TAG = Sliding()


@njit
def force(law: Any, physics: Physics, state: Any) -> Wrench:
    """Return the total force on the cube [N]; its torque is left out."""
    if not reaches(law, height_of(physics, state) - physics.reach):
        return 0.0, 0.0, -physics.weight, 0.0, 0.0, 0.0
    x, y, z = state.position[0], state.position[1], state.position[2]
    ux, uy, uz = state.velocity[0], state.velocity[1], state.velocity[2]
    nodes = state.node_offset
    fx = fy = fz = 0.0
    for k in range(nodes.shape[0]):
        depth = -upward(physics, x + nodes[k, 0], y + nodes[k, 1], z + nodes[k, 2])
        gx, gy, gz = node_force(law, physics, depth, ux, uy, uz)
        fx += gx
        fy += gy
        fz += gz
    return fx, fy, fz, 0.0, 0.0, 0.0


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
