"""The motion between two events: as long as the same nodes touch and are pushed, its equations are smooth.

A regime says of each node whether it is below the ground and whether the ground's force on it is positive. In a regime
the forces are taken as these two answers say, past the event that ends it, too, so that no step of an integrator ever
meets a jump or a kink. Events are the zeros of the switches, two for each node: its depth, and the force that the
contact law would give it, S d − D u, before the law cuts it off at zero.

The motion is a vector: position [m], velocity [m/s], angular momentum [kg m²/s], and the quaternion (scalar first) that
turned the nodes since the vector was made; of a body that does not turn the last two stay as they are.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import split, upward
from stiffdice.dynamics.state import Physics

# Parts of a motion, 13, and as many more as make it whole vectors of the processor.
SIZE = 16

# What a regime says of a node, as bits.
BELOW = 1
PUSHED = 2

NODES = 8
SWITCHES = 2 * NODES  # depth and force of node k are 2k and 2k + 1

# Units in the last place of the height, and of a speed, within which a switch is taken for zero.
_ULPS = 8 * 2.0**-52


@njit
def _turned(motion: Any, sense: float, a: float, b: float, c: float) -> tuple[float, float, float]:
    """Return a vector turned by the motion's quaternion, or with sense −1 turned back.

    The quaternion's norm is one but for what integration makes of it within a step.
    """
    w, x, y, z = motion[9], sense * motion[10], sense * motion[11], sense * motion[12]
    p, q, r = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + 2.0 * (w * p + y * r - z * q),
        b + 2.0 * (w * q + z * p - x * r),
        c + 2.0 * (w * r + x * q - y * p),
    )


@njit
def node_of(
    turning: bool, physics: Physics, nodes: Any, motion: Any, k: int
) -> tuple[float, float, float, float, float, float]:
    """Return place relative to the centre [m] and velocity [m/s] of node k."""
    if not turning:
        return nodes[k, 0], nodes[k, 1], nodes[k, 2], motion[3], motion[4], motion[5]
    rx, ry, rz = _turned(motion, 1.0, nodes[k, 0], nodes[k, 1], nodes[k, 2])
    inverse = 1.0 / physics.inertia
    wx, wy, wz = inverse * motion[6], inverse * motion[7], inverse * motion[8]
    return (
        rx,
        ry,
        rz,
        motion[3] + (wy * rz - wz * ry),
        motion[4] + (wz * rx - wx * rz),
        motion[5] + (wx * ry - wy * rx),
    )


@njit
def contact_of(
    turning: bool, physics: Physics, nodes: Any, motion: Any, k: int
) -> tuple[float, float, float, float, float, float, float, float]:
    """Return node k's place relative to the centre [m], clearance [m], speed along the normal, and slip [m/s]."""
    height = upward(physics, motion[0], motion[1], motion[2])
    rx, ry, rz, vx, vy, vz = node_of(turning, physics, nodes, motion, k)
    clearance = height + physics.nx * rx + physics.ny * ry + physics.nz * rz
    speed, sx, sy, sz = split(physics, vx, vy, vz)
    return rx, ry, rz, clearance, speed, sx, sy, sz


@njit
def push_of(physics: Physics, bits: int, clearance: float, speed: float) -> float:
    """Return the normal force [N] on a node that is pushed; clearance [m], speed [m/s]: away from the ground."""
    push = -physics.damping * speed
    return push - physics.stiffness * clearance if bits & BELOW else push


@njit
def derivative(turning: bool, physics: Physics, nodes: Any, regime: Any, motion: Any, rate: Any) -> None:
    """Set `rate` to the motion's time derivative in a regime (equations 3 to 5, 8, 10; q' = ω q/2).

    nodes [m]: shape (8, 3), before they are turned. regime: bits of each node, shape (8,).
    """
    fx = fy = fz = tx = ty = tz = 0.0
    for k in range(NODES):
        if regime[k] & PUSHED == 0:
            continue
        rx, ry, rz, clearance, speed, sx, sy, sz = contact_of(turning, physics, nodes, motion, k)
        push = push_of(physics, regime[k], clearance, speed)
        grip = physics.friction * push / (math.sqrt(sx * sx + sy * sy + sz * sz) + physics.cutoff)
        gx = push * physics.nx - grip * sx
        gy = push * physics.ny - grip * sy
        gz = push * physics.nz - grip * sz
        fx += gx
        fy += gy
        fz += gz
        tx += ry * gz - rz * gy
        ty += rz * gx - rx * gz
        tz += rx * gy - ry * gx
    rate[0], rate[1], rate[2] = motion[3], motion[4], motion[5]
    rate[3] = fx / physics.mass
    rate[4] = fy / physics.mass
    rate[5] = (fz - physics.weight) / physics.mass
    if turning:
        rate[6], rate[7], rate[8] = tx, ty, tz
        x, y, z = motion[6] / physics.inertia / 2, motion[7] / physics.inertia / 2, motion[8] / physics.inertia / 2
        turned = motion[9], motion[10], motion[11], motion[12]
        rate[9], rate[10], rate[11], rate[12] = quaternion_rate(x, y, z, *turned)


@njit
def quaternion_rate(
    x: float, y: float, z: float, a: float, b: float, c: float, d: float
) -> tuple[float, float, float, float]:
    """Return the product of half a spin (0, x, y, z) [rad/s] and a quaternion (a, b, c, d)."""
    return -x * b - y * c - z * d, x * a + y * d - z * c, y * a + z * b - x * d, z * a + x * c - y * b


@njit
def switches(
    turning: bool,
    dragging: bool,
    physics: Physics,
    nodes: Any,
    regime: Any,
    motion: Any,
    rate: Any,
    value: Any,
    slope: Any,
) -> None:
    """Set values and time derivatives of the switches, shape (16,): positive as long as the regime lasts.

    Depths in m; forces in N. A switch that nothing hangs on is 1 for ever.
    """
    height = upward(physics, motion[0], motion[1], motion[2])
    centre_speed = upward(physics, motion[3], motion[4], motion[5])
    centre_gain = upward(physics, rate[3], rate[4], rate[5])
    lx, ly, lz, sx, sy, sz, gx, gy, gz = _normals(turning, physics, motion, rate)
    for k in range(NODES):
        a, b, c = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        clearance = height + lx * a + ly * b + lz * c
        speed = centre_speed + sx * a + sy * b + sz * c
        below = regime[k] & BELOW != 0
        value[2 * k], slope[2 * k] = (-clearance, -speed) if below else (clearance, speed)
        value[2 * k + 1], slope[2 * k + 1] = 1.0, 0.0
        if physics.damping == 0.0 or not (below or dragging):
            continue
        gain = centre_gain + gx * a + gy * b + gz * c
        push, change = -physics.damping * speed, -physics.damping * gain
        if below:
            push -= physics.stiffness * clearance
            change -= physics.stiffness * speed
        pushed = regime[k] & PUSHED != 0
        value[2 * k + 1], slope[2 * k + 1] = (push, change) if pushed else (-push, -change)


@njit
def _normals(
    turning: bool, physics: Physics, motion: Any, rate: Any
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Return three vectors of which the products with a node, not turned yet, are its level, speed and acceleration.

    They are along the normal n and relative to the centre; turned back, n, n × ω and n × α + (n·ω) ω − ω² n: for
    n·(ω × r) = (n × ω)·r, and n·(ω × (ω × r)) = (n·ω)(ω·r) − ω² n·r.
    """
    nx, ny, nz = physics.nx, physics.ny, physics.nz
    if not turning:
        return nx, ny, nz, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    inverse = 1.0 / physics.inertia
    wx, wy, wz = inverse * motion[6], inverse * motion[7], inverse * motion[8]
    bx, by, bz = inverse * rate[6], inverse * rate[7], inverse * rate[8]
    along, square = nx * wx + ny * wy + nz * wz, wx * wx + wy * wy + wz * wz
    lx, ly, lz = _turned(motion, -1.0, nx, ny, nz)
    sx, sy, sz = _turned(motion, -1.0, ny * wz - nz * wy, nz * wx - nx * wz, nx * wy - ny * wx)
    gx, gy, gz = _turned(
        motion,
        -1.0,
        ny * bz - nz * by + along * wx - square * nx,
        nz * bx - nx * bz + along * wy - square * ny,
        nx * by - ny * bx + along * wz - square * nz,
    )
    return lx, ly, lz, sx, sy, sz, gx, gy, gz


@njit
def vanishing(physics: Physics, motion: Any, small: Any) -> None:
    """Set below which size a depth [m] and a force [N] are zero but for round-off, shape (2,)."""
    length = abs(motion[0]) * abs(physics.nx) + abs(motion[1]) * abs(physics.ny) + abs(motion[2]) * abs(physics.nz)
    small[0] = _ULPS * (length + physics.reach)
    small[1] = physics.stiffness * small[0] + physics.damping * _ULPS * fastest(physics, motion)


@njit
def fastest(physics: Physics, motion: Any) -> float:
    """Return a speed that no node exceeds [m/s]."""
    speed = math.sqrt(motion[3] ** 2 + motion[4] ** 2 + motion[5] ** 2)
    spin = math.sqrt(motion[6] ** 2 + motion[7] ** 2 + motion[8] ** 2)
    return speed + physics.reach * spin / physics.inertia


@njit
def passes(regime: Any, switch: int) -> bool:
    """Return whether a node that the ground does not push is about to leave it: no force changes by that."""
    return switch % 2 == 0 and regime[switch // 2] == BELOW


@njit
def begin(turning: bool, dragging: bool, physics: Physics, nodes: Any, motion: Any, regime: Any, small: Any) -> None:
    """Set the regime that a motion is in; small: from `vanishing`."""
    for k in range(NODES):
        _, _, _, clearance, speed, _, _, _ = contact_of(turning, physics, nodes, motion, k)
        # A node that is about at the ground is on the side to which it goes.
        touching = abs(clearance) <= small[0]
        below = speed < 0.0 if touching else clearance < 0.0
        regime[k] = _answers(dragging, physics, below, clearance, speed)


@njit
def _answers(dragging: bool, physics: Physics, below: bool, clearance: float, speed: float) -> int:
    if not below:
        return PUSHED if dragging and -physics.damping * speed > 0.0 else 0
    if physics.damping == 0.0 or -physics.stiffness * clearance - physics.damping * speed > 0.0:
        return BELOW | PUSHED
    return BELOW


@njit
def cross(turning: bool, dragging: bool, physics: Physics, nodes: Any, motion: Any, regime: Any, switch: int) -> None:
    """Change the regime where a switch went through zero."""
    k = switch // 2
    if switch % 2:
        regime[k] ^= PUSHED
        return
    speed = contact_of(turning, physics, nodes, motion, k)[4]
    regime[k] = _answers(dragging, physics, regime[k] & BELOW == 0, 0.0, speed)


@njit
def force_free(regime: Any) -> bool:
    """Return whether the ground leaves the body alone, and no node is below it."""
    return not np.any(regime)


@njit
def take(turning: bool, state: Any, motion: Any) -> None:
    """Set a motion to a state's, not turned yet."""
    for axis in range(3):
        motion[axis] = state.position[axis]
        motion[3 + axis] = state.velocity[axis]
        motion[6 + axis] = state.angular_momentum[axis] if turning else 0.0
        motion[10 + axis] = 0.0
    motion[9] = 1.0


@njit
def give(turning: bool, physics: Physics, nodes: Any, motion: Any, state: Any) -> None:
    """Set a state to a motion's, turning the nodes it began with."""
    for axis in range(3):
        state.position[axis] = motion[axis]
        state.velocity[axis] = motion[3 + axis]
    if turning:
        for axis in range(3):
            state.angular_momentum[axis] = motion[6 + axis]
            state.angular_velocity[axis] = motion[6 + axis] / physics.inertia
        for k in range(NODES):
            x, y, z = _turned(motion, 1.0, nodes[k, 0], nodes[k, 1], nodes[k, 2])
            state.node_offset[k, 0], state.node_offset[k, 1], state.node_offset[k, 2] = x, y, z


@njit
def normalise(motion: Any) -> None:
    """Give the quaternion the norm one."""
    norm = math.sqrt(motion[9] ** 2 + motion[10] ** 2 + motion[11] ** 2 + motion[12] ** 2)
    for part in range(9, 13):
        motion[part] /= norm


@njit
def hardness(turning: bool, physics: Physics, nodes: Any, regime: Any, motion: Any, hard: Any) -> None:
    """Set `hard` to the contact's frequency [rad/s], its fastest friction or damping [1/s], and its speed [m/s].

    The frequency is a bound, from the trace of M⁻¹ S Σ JᵀJ over the nodes below the ground; the speed is that of the
    contact's motion along the normal: the fastest node's, or what its depth or the weight stands for.
    """
    square = rubbing = speed_most = depth_most = 0.0
    height = upward(physics, motion[0], motion[1], motion[2])
    for k in range(NODES):
        if regime[k] == 0:
            continue
        rx, ry, rz, vx, vy, vz = node_of(turning, physics, nodes, motion, k)
        level, speed = upward(physics, rx, ry, rz), upward(physics, vx, vy, vz)
        pliancy = 1.0 / physics.mass
        arm = rx * rx + ry * ry + rz * rz
        along = pliancy + (arm - level * level) / physics.inertia if turning else pliancy
        across = pliancy + arm / physics.inertia if turning else pliancy
        push = -physics.damping * speed
        if regime[k] & BELOW:
            square += physics.stiffness * along
            push -= physics.stiffness * (height + level)
            speed_most = max(speed_most, abs(speed))
            depth_most = max(depth_most, abs(height + level))
        if regime[k] & PUSHED:
            slip = math.sqrt(max(0.0, vx * vx + vy * vy + vz * vz - speed * speed))
            rubbing += physics.friction * max(0.0, push) / (slip + physics.cutoff) * across + physics.damping * along
    frequency = math.sqrt(square)
    hard[0], hard[1] = frequency, rubbing
    hard[2] = speed_most + frequency * depth_most
    if frequency > 0.0:
        hard[2] += physics.gravity / frequency
