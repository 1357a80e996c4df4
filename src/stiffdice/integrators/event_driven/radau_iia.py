"""Radau's implicit method IIA of five stages and order 9: for motions with friction that all but holds.

Regularised friction pulls a slow node's slip to nearly nothing within about cutoff/(μ × its acceleration), some 1e-6 of
a bounce; from then on the slip is whatever force the motion needs, and the motion obeys a constraint that turns with
the body: as equations of index 2, for which this method keeps its order in place and velocity. The stages are found by
Newton's method with the slopes of every stage: what was held at the start of a step is not what is held at its end.

Regularised friction, s/(|s| + ε) of the most that it can be, is straight as long as a slip s is small beside the
cutoff ε, and flat beyond. Newton's method on it as it is jumps to and fro over that knee. So the tangent is taken not
where the iterations are, but at slips that follow them.

With A and B the slopes of the accelerations a in the velocities u and in the place x, the unknowns are the changes of u
alone: x follows from x' = u. Hairer and Wanner, Solving Ordinary Differential Equations II, IV.5, IV.8 and VII.4.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stiffdice.dynamics import vector
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import normal_of
from stiffdice.dynamics.state import Physics
from stiffdice.dynamics.vector import Vector, cross, dot, minus, norm, plus, plus_times, row, times, unit
from stiffdice.integrators.event_driven import active_set
from stiffdice.integrators.event_driven.active_set import (
    BELOW,
    NODES,
    PUSHED,
    SIZE,
    Contact,
    change_by_turn,
    node_of,
    push_of,
    spin_by,
    spin_of,
)

STAGES = 5
ORDER = 7  # of the error estimate

# Stage i is at the part PARTS[i] of a step, and Σ_j COUPLING[i, j] k_j h from its start; the last is its end.
PARTS = np.array([0.05710419611451768, 0.2768430136381238, 0.5835904323689168, 0.8602401356562195, 1.0])
COUPLING = np.array(
    [
        [0.07299886431790333, -0.02673533110794557, 0.018676929763984353, -0.01287910609330644, 0.005042839233882015],
        [0.15377523147918246, 0.14621486784749352, -0.03644456890512809, 0.02123306311930472, -0.007935579902728777],
        [0.14006304568480987, 0.29896712949128346, 0.16758507013524895, -0.03396910168661774, 0.010944288744192253],
        [0.14489430810953477, 0.2765000687601592, 0.32579792291042103, 0.12875675325490976, -0.015708917378805327],
        [0.14371356079122594, 0.28135601514946207, 0.31182652297574126, 0.22310390108357075, 0.04],
    ]
)


def _beyond(stages: list[int]) -> Any:
    """Return weights of the stages' changes: the end's less what the start and some stages, as a polynomial, tell."""
    weights = np.zeros(STAGES)
    weights[-1] = 1.0
    for stage in stages:
        others = np.array([0.0, *(PARTS[other] for other in stages if other != stage)])
        weights[stage] = -np.prod((1.0 - others) / (PARTS[stage] - others))
    return weights


_ERROR_4, _ERROR_2 = _beyond([0, 1, 2, 3]), _beyond([1, 3])

# Newton's method: iterations at most, the part of the tolerated error at which it ends, and the part of the last
# correction above which the slopes are worked out anew.
_ITERATIONS, _ENOUGH, _SLOW = 12, 1e-2, 0.1


@njit
def step(contact: Contact, start: Any, h: float, end: Any, scale: Any) -> tuple[float, int]:
    """Set `end` to the motion `start` after h [s] in a regime; return the error over what is tolerated, evaluations.

    scale: what is tolerated of each part. The error is infinite where no stages are found.
    """
    unknowns = 6 if contact.turning else 3
    change, rates, rest = np.zeros((STAGES, SIZE)), np.zeros((STAGES, SIZE)), np.empty(STAGES * unknowns)
    by_speed, by_place = np.empty((STAGES, 6, 6)), np.empty((STAGES, 6, 6))
    factors, about = np.empty((STAGES * unknowns, STAGES * unknowns)), np.zeros((STAGES, NODES, 3))
    slips(contact, start, about[0])
    slopes(contact, start, about[0], by_speed[0], by_place[0])
    for stage in range(1, STAGES):
        for node in range(NODES):
            vector.assign(about[stage, node], about[0, node])
        for part in range(6):
            vector.assign(by_speed[stage, part], by_speed[0, part])
            vector.assign(by_place[stage, part], by_place[0, part])
    _follow(contact, start, h, change, rates, end, scale)
    correction, last, iteration, fresh, found = 0.0, 0.0, 0, True, False
    # One that wanders off may find other stages, as smooth and as wrong.
    while not found and iteration < _ITERATIONS and (iteration < 3 or correction < last):
        for stage in range(STAGES):
            _reach(start, change[stage], end)
            active_set.derivative(contact, end, rates[stage])
            straighten(contact, end, about[stage], rates[stage])
            if fresh and iteration > 0:
                slopes(contact, end, about[stage], by_speed[stage], by_place[stage])
        if fresh:
            _couple(by_speed, by_place, h, unknowns, factors)
            vector.factorise(factors)
        last, correction = correction, _correct(change, rates, h, unknowns, factors, rest, scale)
        correction = max(correction, _follow(contact, start, h, change, rates, end, scale))
        off = 0.0
        for stage in range(STAGES):
            _reach(start, change[stage], end)
            off = max(off, retouch(contact, end, about[stage]) / scale[3])
        iteration += 1
        left = correction * min(1.0, correction / last) if last > 0.0 else correction
        found = left <= _ENOUGH and off <= _ENOUGH
        fresh = iteration == 1 or off > _ENOUGH or correction > _SLOW * last
    _reach(start, change[STAGES - 1], end)
    return _error(change, unknowns, scale) if found else math.inf, STAGES * iteration


@njit
def _reach(start: Any, change: Any, motion: Any) -> None:
    for part in range(SIZE):
        motion[part] = start[part] + change[part]


@njit
def _couple(by_speed: Any, by_place: Any, h: float, unknowns: int, matrix: Any) -> None:
    """Set `matrix` to the slopes of what is left of the stages' equations: 1 − h a_ij A_j − h² Σ_k a_ik B_k a_kj."""
    for i in range(STAGES):
        for j in range(STAGES):
            for p in range(unknowns):
                for q in range(unknowns):
                    slope = COUPLING[i, j] * by_speed[j, p, q]
                    for k in range(STAGES):
                        slope += h * COUPLING[i, k] * COUPLING[k, j] * by_place[k, p, q]
                    matrix[i * unknowns + p, j * unknowns + q] = (1.0 if i == j and p == q else 0.0) - h * slope


@njit
def _gained(rates: Any, h: float, stage: int, part: int) -> float:
    """Return what a part of the motion gains until a stage by the rates at all stages."""
    total = 0.0
    for j in range(STAGES):
        total += COUPLING[stage, j] * rates[j, part]
    return h * total


@njit
def _correct(change: Any, rates: Any, h: float, unknowns: int, factors: Any, rest: Any, scale: Any) -> float:
    """Correct the changes of the velocities by one iteration; return by how much, over what is tolerated."""
    for i in range(STAGES):
        for part in range(unknowns):
            rest[i * unknowns + part] = _gained(rates, h, i, 3 + part) - change[i, 3 + part]
    vector.solve(factors, rest)
    most = 0.0
    for i in range(STAGES):
        for part in range(unknowns):
            correction = rest[i * unknowns + part]
            change[i, 3 + part] += correction
            size = abs(correction) / scale[3 + part]
            most = size if not size <= most else most  # not-a-number, too
    return most


@njit
def _follow(contact: Contact, start: Any, h: float, change: Any, rates: Any, end: Any, scale: Any) -> float:
    """Change places and turns as the velocities say; return by how much the turns, over what is tolerated.

    end: scratch.
    """
    for stage in range(STAGES):
        rate, moved = rates[stage], change[stage]
        for axis in range(3):
            rate[axis] = start[3 + axis] + moved[3 + axis]
        if contact.turning:
            _reach(start, moved, end)
            x, y, z = times(0.5, spin_of(contact, end))
            a, b, c, d = end[9], end[10], end[11], end[12]
            rate[9], rate[10], rate[11], rate[12] = active_set.quaternion_rate(x, y, z, a, b, c, d)
    most = 0.0
    for stage in range(STAGES):
        for part in range(SIZE):
            if 3 <= part < 9:
                continue
            gained = _gained(rates, h, stage, part)
            if part >= 9:
                most = max(most, abs(gained - change[stage, part]) / scale[part])
            change[stage, part] = gained
    return most


@njit
def _error(change: Any, unknowns: int, scale: Any) -> float:
    """Return the estimated error over what is tolerated, err4²/√(err4² + err2²/100), in the manner of DOP853.

    What is compared are the stages alone, and not divided by friction's stiffness as usual (Hairer and Wanner, IV.8):
    that of the start would hide what a node does that is let go before the end.
    """
    fourth = second = 0.0
    for part in range(3, 3 + unknowns):
        fine = coarse = 0.0
        for stage in range(STAGES):
            fine += _ERROR_4[stage] * change[stage, part]
            coarse += _ERROR_2[stage] * change[stage, part]
        fourth, second = max(fourth, abs(fine) / scale[part]), max(second, abs(coarse) / scale[part])
    return fourth * fourth / math.sqrt(fourth * fourth + 0.01 * second * second) if fourth > 0.0 else 0.0


@njit
def slips(contact: Contact, motion: Any, about: Any) -> None:
    """Set the velocity along the ground [m/s] of each node that is pushed, shape (8, 3)."""
    for k in range(NODES):
        if contact.regime.bits[k] & PUSHED:
            about[k, 0], about[k, 1], about[k, 2] = node_of(contact, motion, k).slip


@njit
def _tangent(physics: Physics, about: Vector) -> tuple[float, float]:
    """Return what the tangent of s/(|s| + ε) at a slip takes of a change of slip, and what bends it along that slip."""
    length = norm(about)
    long = length + physics.cutoff
    return 1.0 / long, 1.0 / (length * long * long) if length > 0.0 else 0.0


@njit
def _share(physics: Physics, about: Vector, slip: Vector) -> Vector:
    """Return s/(|s| + ε) of a slip by its tangent at the slip `about`."""
    grip, bend = _tangent(physics, about)
    return plus_times(times(grip, slip), bend * (dot(about, about) - dot(about, slip)), about)


@njit
def retouch(contact: Contact, motion: Any, about: Any) -> float:
    """Move the slips `about` towards a motion's own, shape (8, 3); return what their tangents were off by [m/s].

    Friction's law has a knee: its tangent at a slip tells little beyond. Where a slip has become larger than its
    tangent holds for, the friction that the tangent gives is kept, below the greatest, and with it the slip that has
    it; where one has turned round, none is taken (as for a diode: Nagel 1975, SPICE2, junction limiting).
    """
    physics, off = contact.physics, 0.0
    for k in range(NODES):
        if contact.regime.bits[k] & PUSHED == 0:
            continue
        here, there = row(about, k), node_of(contact, motion, k).slip
        length, most, apart = norm(here), norm(there), norm(minus(there, here))
        off = max(off, apart * apart / (min(length, most) + physics.cutoff))
        if apart > 0.5 * (length + physics.cutoff):
            kept = _share(physics, here, there)
            if most > length and norm(kept) < 1.0:
                there = times(physics.cutoff / (1.0 - norm(kept)), kept)
            elif dot(here, there) < 0.0 and most > physics.cutoff:
                there = Vector(0.0, 0.0, 0.0)
        about[k, 0], about[k, 1], about[k, 2] = there
    return off


@njit
def straighten(contact: Contact, motion: Any, about: Any, rate: Any) -> None:
    """Change a motion's rate to what it were, were friction by its tangent at the slips `about`, shape (8, 3)."""
    physics = contact.physics
    for k in range(NODES):
        if contact.regime.bits[k] & PUSHED == 0:
            continue
        node = node_of(contact, motion, k)
        own = times(1.0 / (norm(node.slip) + physics.cutoff), node.slip)
        change = minus(own, _share(physics, row(about, k), node.slip))
        force = times(physics.friction * push_of(contact, k, node), change)
        torque = cross(node.arm, force)
        for axis in range(3):
            rate[3 + axis] += force[axis] / physics.mass
            rate[6 + axis] += torque[axis]


@njit
def slopes(contact: Contact, motion: Any, about: Any, by_speed: Any, by_place: Any) -> None:
    """Set the slopes of u' and L', shape (6, 6) each: in u and L, and in place and I times rotation.

    A node's force f n − μ f p, with f = S d − D u, s the velocity along the ground and p = s/(|s| + ε) by its tangent
    at the slip `about` (shape (8, 3)), changes with the node's velocity v and place x by
    −(n − μ p) (D n·δv + S n·δx) − μ f δp.
    A rotation δθ moves the node, and the torque's arm, by δθ × r, and its velocity by ω × (δθ × r); of a box, by the
    change of its spin, too.
    """
    physics = contact.physics
    by_speed.fill(0.0)
    by_place.fill(0.0)
    spin, none = spin_of(contact, motion), Vector(0.0, 0.0, 0.0)
    for k in range(NODES):
        if contact.regime.bits[k] & PUSHED == 0:
            continue
        node, tangent = node_of(contact, motion, k), row(about, k)
        spring = physics.stiffness if contact.regime.bits[k] & BELOW else 0.0
        push = push_of(contact, k, node)
        line = plus_times(normal_of(physics), -physics.friction, _share(physics, tangent, node.slip))
        law = spring, push, line, tangent, _tangent(physics, tangent)
        for axis in range(3):
            one = unit(axis)
            _add(physics, node.arm, _force_change(physics, law, one, none), none, by_speed, axis)
            _add(physics, node.arm, _force_change(physics, law, none, one), none, by_place, axis)
            if contact.turning:
                turn = spin_by(physics.body, contact, motion, one)
                moved = cross(turn, node.arm)
                spun = cross(change_by_turn(physics.body, contact, motion, turn), node.arm)
                change = _force_change(physics, law, plus(cross(spin, moved), spun), moved)
                _add(physics, node.arm, _force_change(physics, law, moved, none), none, by_speed, 3 + axis)
                _add(physics, node.arm, change, cross(moved, times(push, line)), by_place, 3 + axis)


@njit
def _force_change(physics: Physics, law: Any, velocity: Vector, place: Vector) -> Vector:
    """Return by how much the force on a node changes with its velocity and its place.

    law: the spring's stiffness, the normal force, the force's direction over it, the slip of the tangent, and that.
    """
    spring, push, line, about, (grip, bend) = law
    n = normal_of(physics)
    speed = dot(n, velocity)
    lost = physics.damping * speed + spring * dot(n, place)
    slip = plus_times(velocity, -speed, n)
    change = plus_times(times(grip, slip), -bend * dot(about, slip), about)
    return plus_times(times(-lost, line), -physics.friction * push, change)


@njit
def _add(physics: Physics, arm: Vector, force: Vector, torque: Vector, slope: Any, column: int) -> None:
    """Add to a column of the slopes of u' and L' what a force on a node at `arm` does, and a torque."""
    turned = plus(cross(arm, force), torque)
    for axis in range(3):
        slope[axis, column] += force[axis] / physics.mass
        slope[3 + axis, column] += turned[axis]
