"""`tumbling`: translation and rotation of a rigid cube, the paper's real_throw_cube.m, or of another box.

A cube's inertia is the same about every axis, so that the spin is L/I however the cube is turned: no tensor turns with
it (paper, section 2.1). That of another box does (`inertia.py`).
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

from stiffdice.dynamics import inertia
from stiffdice.dynamics.compilation import by_tag, constant, njit
from stiffdice.dynamics.contact import Wrench, node_force, node_velocity, upward
from stiffdice.dynamics.inertia import Box, Isotropic
from stiffdice.dynamics.models import sliding
from stiffdice.dynamics.state import Physics
from stiffdice.dynamics.vector import Vector, cross, plus, row, vector

Tumbling = namedtuple("Tumbling", ())
TAG = Tumbling()


@njit
def force(physics: Physics, state: Any) -> Wrench:
    """Return the total force [N] and torque about the centre [N m] (equations 3 and 10)."""
    place, total, torque = vector(state.position), Vector(0.0, 0.0, 0.0), Vector(0.0, 0.0, 0.0)
    for k in range(len(state.node_offset)):
        arm = row(state.node_offset, k)
        on_node = node_force(physics, -upward(physics, plus(place, arm)), node_velocity(state, k))
        total, torque = plus(total, on_node), plus(torque, cross(arm, on_node))
    torque = plus(torque, _of_weight(physics.body, physics, state))
    return total.x, total.y, total.z, torque.x, torque.y, torque.z


@njit
def _of_weight_of_box(physics: Physics, state: Any) -> Vector:
    lever = Vector(0.0, 0.0, 0.0)
    for k in range(len(state.node_offset)):
        lever = plus(lever, row(state.node_offset, k))
    return cross(lever, Vector(0.0, 0.0, physics.node_weight))


# (body, physics, state) -> the torque [N m] that takes back that of the nodes' weights: all of it acts at the centre of
# mass. That of a cube's is none.
_of_weight = by_tag({Isotropic: constant(Vector(0.0, 0.0, 0.0)), Box: _of_weight_of_box})


@njit
def kick(physics: Physics, state: Any, wrench: Wrench, h: float) -> None:
    """Advance velocity and angular momentum, and the spin with it, by h [s] (equations 6 and 8)."""
    sliding.kick(physics, state, wrench, h)
    for axis in range(3):
        state.angular_momentum[axis] += h * wrench[3 + axis]
    _spin(physics, state)


@njit
def drift(physics: Physics, state: Any, h: float) -> None:
    """Advance position and orientation by h [s] at the state's velocity and spin (equations 7 and 9)."""
    sliding.drift(physics, state, h)
    turn(physics, state, h)


@njit
def turn(physics: Physics, state: Any, duration: float) -> None:
    """Turn the nodes for so long [s] at the spin that the angular momentum says (equation 9)."""
    _spin(physics, state)
    inertia.turn(physics.body, physics, state, duration)


@njit
def _spin(physics: Physics, state: Any) -> None:
    """Let the nodes move with the spin that the angular momentum says."""
    spin = state.angular_velocity
    spin[0], spin[1], spin[2] = inertia.spin_of(physics.body, physics, state, vector(state.angular_momentum))
