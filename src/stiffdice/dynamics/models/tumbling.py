"""`tumbling`: translation and rotation of a rigid cube, the paper's real_throw_cube.m.

A cube's inertia is the same about every axis, so that the spin is L/I however the cube is turned: no tensor turns with
it (paper, section 2.1).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import Wrench, height_of, node_force, reaches
from stiffdice.dynamics.models import sliding
from stiffdice.dynamics.state import Motion, Physics


class Tumbling(NamedTuple):
    """The tag of this model."""


TAG = Tumbling()


@njit
def force(law: Any, physics: Physics, state: Any) -> Wrench:
    """Return the total force [N] and torque about the centre [N m] (equations 3 and 10)."""
    if not reaches(law, height_of(physics, state) - physics.reach):
        return 0.0, 0.0, -physics.weight, 0.0, 0.0, 0.0
    x, y, z = state.position[0], state.position[1], state.position[2]
    ux, uy, uz = state.velocity[0], state.velocity[1], state.velocity[2]
    wx, wy, wz = state.angular_velocity[0], state.angular_velocity[1], state.angular_velocity[2]
    nodes = state.node_offset
    fx = fy = fz = tx = ty = tz = 0.0
    for k in range(nodes.shape[0]):
        rx, ry, rz = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        depth = -(physics.nx * (x + rx) + physics.ny * (y + ry) + physics.nz * (z + rz))
        vx = ux + (wy * rz - wz * ry)
        vy = uy + (wz * rx - wx * rz)
        vz = uz + (wx * ry - wy * rx)
        gx, gy, gz = node_force(law, physics, depth, vx, vy, vz)
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
    state.angular_momentum[0] += h * wrench[3]
    state.angular_momentum[1] += h * wrench[4]
    state.angular_momentum[2] += h * wrench[5]
    _spin(physics, state)


@njit
def drift(physics: Physics, state: Any, h: float) -> None:
    """Advance position and orientation by h [s] at the state's velocity and spin (equations 7 and 9)."""
    sliding.drift(physics, state, h)
    turn(physics, state, h)


@njit
def motion(physics: Physics, state: Any) -> Motion:
    """Return the velocity [m/s] and the spin [rad/s] that the angular momentum says."""
    ux, uy, uz = state.velocity[0], state.velocity[1], state.velocity[2]
    lx, ly, lz = state.angular_momentum[0], state.angular_momentum[1], state.angular_momentum[2]
    return ux, uy, uz, lx / physics.inertia, ly / physics.inertia, lz / physics.inertia


@njit
def move(state: Any, shift: Motion) -> None:
    """Shift the position by the first three [m], and turn the nodes by the rotation vector of the others [rad]."""
    sliding.move(state, shift)
    ax, ay, az = shift[3], shift[4], shift[5]
    angle = math.sqrt(ax * ax + ay * ay + az * az)
    if angle > 0.0:
        _rotate(state, ax / angle, ay / angle, az / angle, angle)


@njit
def turn(physics: Physics, state: Any, duration: float) -> None:
    """Turn the nodes for so long [s] at the spin that the angular momentum says (equation 9)."""
    wx, wy, wz = _spin(physics, state)
    rate = math.sqrt(wx * wx + wy * wy + wz * wz)
    if rate > 0.0:
        _rotate(state, wx / rate, wy / rate, wz / rate, rate * duration)


@njit
def _spin(physics: Physics, state: Any) -> tuple[float, float, float]:
    """Let the nodes move with the spin that the angular momentum says, and return it [rad/s]."""
    wx = state.angular_momentum[0] / physics.inertia
    wy = state.angular_momentum[1] / physics.inertia
    wz = state.angular_momentum[2] / physics.inertia
    state.angular_velocity[0], state.angular_velocity[1], state.angular_velocity[2] = wx, wy, wz
    return wx, wy, wz


@njit
def turns() -> bool:
    """Return that the body turns."""
    return True


@njit
def touches() -> bool:
    """Return that the ground can act on the body."""
    return True


@njit
def extent(physics: Physics, state: Any) -> float:
    """Return how far below the centre a node can come, however the cube turns [m]."""
    return physics.reach


@njit
def _rotate(state: Any, ax: float, ay: float, az: float, angle: float) -> None:
    """Turn the nodes about a unit axis: R = P + cos(angle)·(E − P) + sin(angle)·A, after equation 9."""
    c, s = math.cos(angle), math.sin(angle)
    rxx, rxy, rxz = (
        ax * ax + c * (1 - ax * ax),
        ax * ay - c * (ax * ay) - s * az,
        ax * az - c * (ax * az) + s * ay,
    )
    ryx, ryy, ryz = (
        ay * ax - c * (ay * ax) + s * az,
        ay * ay + c * (1 - ay * ay),
        ay * az - c * (ay * az) - s * ax,
    )
    rzx, rzy, rzz = (
        az * ax - c * (az * ax) - s * ay,
        az * ay - c * (az * ay) + s * ax,
        az * az + c * (1 - az * az),
    )
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        x, y, z = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        nodes[k, 0] = rxx * x + rxy * y + rxz * z
        nodes[k, 1] = ryx * x + ryy * y + ryz * z
        nodes[k, 2] = rzx * x + rzy * y + rzz * z
