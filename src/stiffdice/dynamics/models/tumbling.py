"""`tumbling`: translation and rotation of a rigid cube, the paper's real_throw_cube.m.

A cube's inertia is the same about every axis, so that the spin is L/I however the cube is turned: no tensor turns with
it (paper, section 2.1).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import Wrench, height_of, node_force, node_velocity, reaches, upward
from stiffdice.dynamics.models import sliding
from stiffdice.dynamics.state import Physics


class Tumbling(NamedTuple):
    """The tag of this model."""


TAG = Tumbling()


@njit
def force(law: Any, physics: Physics, state: Any) -> Wrench:
    """Return the total force [N] and torque about the centre [N m] (equations 3 and 10)."""
    if not reaches(law, height_of(physics, state) - physics.reach):
        return 0.0, 0.0, -physics.weight, 0.0, 0.0, 0.0
    x, y, z = state.position[0], state.position[1], state.position[2]
    nodes = state.node_offset
    fx = fy = fz = tx = ty = tz = 0.0
    for k in range(nodes.shape[0]):
        rx, ry, rz = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        vx, vy, vz = node_velocity(state, k)
        gx, gy, gz = node_force(law, physics, -upward(physics, x + rx, y + ry, z + rz), vx, vy, vz)
        fx += gx
        fy += gy
        fz += gz
        tx += ry * gz - rz * gy
        ty += rz * gx - rx * gz
        tz += rx * gy - ry * gx
    return fx, fy, fz, tx, ty, tz


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
    wx, wy, wz = _spin(physics, state)
    rate = math.sqrt(wx * wx + wy * wy + wz * wz)
    if rate > 0.0:
        rotate(state, wx / rate, wy / rate, wz / rate, rate * duration)


@njit
def _spin(physics: Physics, state: Any) -> tuple[float, float, float]:
    """Let the nodes move with the spin that the angular momentum says, and return it [rad/s]."""
    for axis in range(3):
        state.angular_velocity[axis] = state.angular_momentum[axis] / physics.inertia
    return state.angular_velocity[0], state.angular_velocity[1], state.angular_velocity[2]


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
