"""`sliding`: translation only, the paper's ground_cube.m. The cube keeps the orientation it starts with."""

from __future__ import annotations

from typing import Any, NamedTuple

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import Wrench, height_of, lowest_of, node_force, reaches
from stiffdice.dynamics.state import Motion, Physics


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
        depth = -(physics.nx * (x + nodes[k, 0]) + physics.ny * (y + nodes[k, 1]) + physics.nz * (z + nodes[k, 2]))
        gx, gy, gz = node_force(law, physics, depth, ux, uy, uz)
        fx += gx
        fy += gy
        fz += gz
    return fx, fy, fz, 0.0, 0.0, 0.0


@njit
def kick(physics: Physics, state: Any, wrench: Wrench, h: float) -> None:
    """Advance the velocity by h [s] under a force (equation 6)."""
    state.velocity[0] += h * wrench[0] / physics.mass
    state.velocity[1] += h * wrench[1] / physics.mass
    state.velocity[2] += h * wrench[2] / physics.mass


@njit
def drift(physics: Physics, state: Any, h: float) -> None:
    """Advance the position by h [s] at the state's velocity (equation 7)."""
    state.position[0] += h * state.velocity[0]
    state.position[1] += h * state.velocity[1]
    state.position[2] += h * state.velocity[2]


@njit
def motion(physics: Physics, state: Any) -> Motion:
    """Return the velocity [m/s], and no spin."""
    return state.velocity[0], state.velocity[1], state.velocity[2], 0.0, 0.0, 0.0


@njit
def move(state: Any, shift: Motion) -> None:
    """Shift the position by the first three [m]."""
    state.position[0] += shift[0]
    state.position[1] += shift[1]
    state.position[2] += shift[2]


@njit
def turn(physics: Physics, state: Any, duration: float) -> None:
    """Do nothing: this model does not turn the cube."""


@njit
def turns() -> bool:
    """Return that the body does not turn."""
    return False


@njit
def touches() -> bool:
    """Return that the ground can act on the body."""
    return True


@njit
def extent(physics: Physics, state: Any) -> float:
    """Return how far below the centre the lowest node is, in a free flight, too [m]."""
    return lowest_of(physics, state)
