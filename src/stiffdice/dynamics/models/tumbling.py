"""`tumbling`: translation and rotation of a rigid cube, the paper's real_throw_cube.m.

A cube's inertia is the same about every axis, so that the spin is L/I however the cube is turned: no tensor turns with
it (paper, section 2.1).
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import Wrench, height_of, node_force, node_velocity, reaches, upward
from stiffdice.dynamics.models import sliding
from stiffdice.dynamics.state import Physics
from stiffdice.dynamics.vector import Vector, cross, norm, plus, row, vector

Tumbling = namedtuple("Tumbling", ())
TAG = Tumbling()


@njit
def force(physics: Physics, state: Any) -> Wrench:
    """Return the total force [N] and torque about the centre [N m] (equations 3 and 10)."""
    if not reaches(physics, height_of(physics, state) - physics.reach):
        return 0.0, 0.0, -physics.weight, 0.0, 0.0, 0.0
    place, total, torque = vector(state.position), Vector(0.0, 0.0, 0.0), Vector(0.0, 0.0, 0.0)
    for k in range(len(state.node_offset)):
        arm = row(state.node_offset, k)
        on_node = node_force(physics, -upward(physics, plus(place, arm)), node_velocity(state, k))
        total, torque = plus(total, on_node), plus(torque, cross(arm, on_node))
    return total.x, total.y, total.z, torque.x, torque.y, torque.z


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
    spin = vector(state.angular_velocity)
    rate = norm(spin)
    if rate > 0.0:
        rotate(state, spin.x / rate, spin.y / rate, spin.z / rate, rate * duration)


@njit
def _spin(physics: Physics, state: Any) -> None:
    """Let the nodes move with the spin that the angular momentum says."""
    for axis in range(3):
        state.angular_velocity[axis] = state.angular_momentum[axis] / physics.inertia


@njit
def rotate(state: Any, ax: float, ay: float, az: float, angle: float) -> None:
    """Turn the nodes about a unit axis: R = P + cos(angle)·(E − P) + sin(angle)·A, after equation 9."""
    c, s = math.cos(angle), math.sin(angle)
    rxx, rxy, rxz = ax * ax + c * (1 - ax * ax), ax * ay - c * (ax * ay) - s * az, ax * az - c * (ax * az) + s * ay
    ryx, ryy, ryz = ay * ax - c * (ay * ax) + s * az, ay * ay + c * (1 - ay * ay), ay * az - c * (ay * az) - s * ax
    rzx, rzy, rzz = az * ax - c * (az * ax) - s * ay, az * ay - c * (az * ay) + s * ax, az * az + c * (1 - az * az)
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        x, y, z = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        nodes[k, 0] = rxx * x + rxy * y + rxz * z
        nodes[k, 1] = ryx * x + ryy * y + ryz * z
        nodes[k, 2] = rzx * x + rzy * y + rzz * z
