"""How a regime's forces change with the motion: what implicit steps need, with friction by its tangent.

Regularised friction, s/(|s| + ε) of the most that it can be, is straight as long as a slip s is small beside the
cutoff ε, and flat beyond. Newton's method on it as it is jumps to and fro over that knee. So the tangent is taken not
where the iterations are, but at slips that follow them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import upward
from stiffdice.dynamics.state import Physics
from stiffdice.integrators.event_driven.active_set import BELOW, NODES, PUSHED, contact_of, push_of


@njit
def slips(turning: bool, physics: Physics, nodes: Any, regime: Any, motion: Any, slip: Any) -> None:
    """Set the velocity along the ground [m/s] of each node that is pushed, shape (8, 3)."""
    for k in range(NODES):
        if regime[k] & PUSHED:
            _slip_of(turning, physics, nodes, motion, k, slip[k])


@njit
def _slip_of(turning: bool, physics: Physics, nodes: Any, motion: Any, k: int, slip: Any) -> None:
    _, _, _, _, _, slip[0], slip[1], slip[2] = contact_of(turning, physics, nodes, motion, k)


@njit
def _rubbing(physics: Physics, slip: Any, about: Any, part: Any) -> tuple[float, float]:
    """Set `part` to s/(|s| + ε) of a slip by its tangent at the slip `about`; return 1/(|s| + ε) there, and `bend`.

    The tangent's slope is δs/(|s| + ε) − bend s (s·δs).
    """
    length = math.sqrt(_dot(about, about))
    long = length + physics.cutoff
    bend = 1.0 / (length * long * long) if length > 0.0 else 0.0
    along = bend * (_dot(about, slip) - length * length)
    for i in range(3):
        part[i] = slip[i] / long - along * about[i]
    return 1.0 / long, bend


@njit
def retouch(turning: bool, physics: Physics, nodes: Any, regime: Any, motion: Any, about: Any) -> float:
    """Move the slips `about` towards a motion's own, shape (8, 3); return what their tangents were off by [m/s].

    Friction's law has a knee: its tangent at a slip tells little beyond. Where a slip has become larger than its
    tangent holds for, the friction that the tangent gives is kept, below the greatest, and with it the slip that has
    it; where one has turned round, none is taken (as for a diode: Nagel 1975, SPICE2, junction limiting).
    """
    there, part = np.empty(3), np.empty(3)
    off = 0.0
    for k in range(NODES):
        if regime[k] & PUSHED == 0:
            continue
        here = about[k]
        _slip_of(turning, physics, nodes, motion, k, there)
        _rubbing(physics, there, here, part)
        most, share = math.sqrt(_dot(there, there)), math.sqrt(_dot(part, part))
        length = math.sqrt(_dot(here, here))
        apart = math.sqrt((there[0] - here[0]) ** 2 + (there[1] - here[1]) ** 2 + (there[2] - here[2]) ** 2)
        off = max(off, apart * apart / (min(length, most) + physics.cutoff))
        factor = 1.0
        if apart > 0.5 * (length + physics.cutoff):
            if most > length and share < 1.0:
                part *= physics.cutoff / (1.0 - share)
                here[:] = part
                continue
            if _dot(here, there) < 0.0 and most > physics.cutoff:
                factor = 0.0
        for i in range(3):
            here[i] = factor * there[i]
    return off


@njit
def straighten(turning: bool, physics: Physics, nodes: Any, regime: Any, motion: Any, about: Any, rate: Any) -> None:
    """Change a motion's rate to what it were, were friction by its tangent at the slips `about`, shape (8, 3)."""
    slip, part, force = np.zeros(3), np.empty(3), np.empty(3)
    for k in range(NODES):
        if regime[k] & PUSHED == 0:
            continue
        rx, ry, rz, clearance, speed, slip[0], slip[1], slip[2] = contact_of(turning, physics, nodes, motion, k)
        push = push_of(physics, regime[k], clearance, speed)
        _rubbing(physics, slip, about[k], part)
        long = math.sqrt(_dot(slip, slip)) + physics.cutoff
        for i in range(3):
            force[i] = physics.friction * push * (slip[i] / long - part[i])
            rate[3 + i] += force[i] / physics.mass
        if turning:
            rate[6] += ry * force[2] - rz * force[1]
            rate[7] += rz * force[0] - rx * force[2]
            rate[8] += rx * force[1] - ry * force[0]


@njit
def slopes(
    turning: bool, physics: Physics, nodes: Any, regime: Any, motion: Any, about: Any, by_speed: Any, by_place: Any
) -> None:
    """Set the slopes of u' and L', shape (6, 6) each: in u and L, and in place and I times rotation.

    A node's force f n − μ f p, with f = S d − D u, s the velocity along the ground and p = s/(|s| + ε) by its tangent
    at the slip `about` (shape (8, 3)), changes with the node's velocity v and place x by
    −(n − μ p) (D n·δv + S n·δx) − μ f δp.
    A rotation δθ moves the node, and the torque's arm, by δθ × r, and its velocity by ω × (δθ × r).
    """
    for i in range(6):
        for j in range(6):
            by_speed[i, j] = by_place[i, j] = 0.0
    by_velocity, by_shift, by_turn, lever = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.zeros((3, 3))
    normal, slip, force, arm, part = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    height = upward(physics, motion[0], motion[1], motion[2])
    normal[0], normal[1], normal[2] = physics.nx, physics.ny, physics.nz
    for k in range(NODES):
        if regime[k] & PUSHED == 0:
            continue
        arm[0], arm[1], arm[2], _, speed, slip[0], slip[1], slip[2] = contact_of(turning, physics, nodes, motion, k)
        spring = physics.stiffness if regime[k] & BELOW else 0.0
        push = -physics.damping * speed - spring * (height + _dot(normal, arm))
        grip, bend = _rubbing(physics, slip, about[k], part)
        grip, bend = physics.friction * push * grip, physics.friction * push * bend
        for i in range(3):
            force[i] = push * (normal[i] - physics.friction * part[i])
            for j in range(3):
                pressed = (normal[i] - physics.friction * part[i]) * normal[j]
                rubbed = grip * normal[i] * normal[j] + bend * about[k, i] * about[k, j]
                by_velocity[i, j] = rubbed - physics.damping * pressed
                by_shift[i, j] = by_turn[i, j] = -spring * pressed
            by_velocity[i, i] -= grip
        _add(by_velocity, 1.0 / physics.mass, by_speed, 0, 0)
        _add(by_shift, 1.0 / physics.mass, by_place, 0, 0)
        if turning:
            lever[0, 1], lever[0, 2], lever[1, 2] = arm[2], -arm[1], arm[0]
            lever[1, 0], lever[2, 0], lever[2, 1] = -arm[2], arm[1], -arm[0]
            _whirled(physics, motion, by_velocity, by_turn)
            _turned_slopes(physics, lever, by_velocity, by_velocity, by_speed)
            _turned_slopes(physics, lever, by_shift, by_turn, by_place)
            _levered(physics, arm, force, by_place)


@njit
def _dot(a: Any, b: Any) -> float:
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@njit
def _add(block: Any, factor: float, slope: Any, row: int, column: int) -> None:
    for i in range(3):
        for j in range(3):
            slope[row + i, column + j] += factor * block[i, j]


@njit
def _whirled(physics: Physics, motion: Any, by_velocity: Any, by_turn: Any) -> None:
    """Add to a force's slope in a node's place what changes with it as the node's velocity: ω × δx."""
    wx, wy, wz = motion[6] / physics.inertia, motion[7] / physics.inertia, motion[8] / physics.inertia
    for i in range(3):
        x, y, z = by_velocity[i, 0], by_velocity[i, 1], by_velocity[i, 2]
        by_turn[i, 0] += y * wz - z * wy
        by_turn[i, 1] += z * wx - x * wz
        by_turn[i, 2] += x * wy - y * wx


@njit
def _levered(physics: Physics, arm: Any, force: Any, slope: Any) -> None:
    """Add how the torque of a force changes with its arm: (δθ × r) × f = r (δθ·f) − δθ (r·f)."""
    along = _dot(arm, force)
    for i in range(3):
        for j in range(3):
            slope[3 + i, 3 + j] += arm[i] * force[j] / physics.inertia
        slope[3 + i, 3 + i] -= along / physics.inertia


@njit
def _turned_slopes(physics: Physics, lever: Any, of_centre: Any, of_turning: Any, slope: Any) -> None:
    """Add what slopes of the force on one node are to the body by its turning, and to its torque.

    lever: the matrix of δθ × r, of which the transpose makes the torque r × f out of f.
    """
    moved = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for p in range(3):
                moved[i, j] += of_turning[i, p] * lever[p, j]
    _add(moved, 1.0 / (physics.mass * physics.inertia), slope, 0, 3)
    for i in range(3):
        for j in range(3):
            for p in range(3):
                slope[3 + i, j] += lever[p, i] * of_centre[p, j]
                slope[3 + i, 3 + j] += lever[p, i] * moved[p, j] / physics.inertia
