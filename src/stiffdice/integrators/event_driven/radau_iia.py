"""Radau's implicit method IIA of five stages and order 9: for motions with friction that all but holds.

Regularised friction pulls a slow node's slip to nearly nothing within about cutoff/(μ × its acceleration), some 1e-6 of
a bounce; from then on the slip is whatever force the motion needs, and the motion obeys a constraint that turns with
the body: as equations of index 2, for which this method keeps its order in place and velocity. The stages are found by
Newton's method with the slopes of every stage: what was held at the start of a step is not what is held at its end.

With A and B the slopes of the accelerations a in the velocities u and in the place x, the unknowns are the changes of u
alone: x follows from x' = u. Hairer and Wanner, Solving Ordinary Differential Equations II, IV.5, IV.8 and VII.4.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.vector import assign
from stiffdice.integrators.event_driven.active_set import NODES, SIZE, Contact, derivative, quaternion_rate
from stiffdice.integrators.event_driven.held_contact import retouch, slips, slopes, straighten
from stiffdice.integrators.linear_equations import factorise, solve

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
            assign(about[stage, node], about[0, node])
        for part in range(6):
            assign(by_speed[stage, part], by_speed[0, part])
            assign(by_place[stage, part], by_place[0, part])
    _follow(contact, start, h, change, rates, scale)
    correction, last, iteration, fresh, found = 0.0, 0.0, 0, True, False
    # One that wanders off may find other stages, as smooth and as wrong.
    while not found and iteration < _ITERATIONS and (iteration < 3 or correction < last):
        for stage in range(STAGES):
            _reach(start, change[stage], end)
            derivative(contact, end, rates[stage])
            straighten(contact, end, about[stage], rates[stage])
            if fresh and iteration > 0:
                slopes(contact, end, about[stage], by_speed[stage], by_place[stage])
        if fresh:
            _couple(by_speed, by_place, h, unknowns, factors)
            factorise(factors)
        last, correction = correction, _correct(change, rates, h, unknowns, factors, rest, scale)
        correction = max(correction, _follow(contact, start, h, change, rates, scale))
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
    solve(factors, rest)
    most = 0.0
    for i in range(STAGES):
        for part in range(unknowns):
            correction = rest[i * unknowns + part]
            change[i, 3 + part] += correction
            size = abs(correction) / scale[3 + part]
            most = size if not size <= most else most  # not-a-number, too
    return most


@njit
def _follow(contact: Contact, start: Any, h: float, change: Any, rates: Any, scale: Any) -> float:
    """Change places and turns as the velocities say; return by how much the turns, over what is tolerated."""
    for stage in range(STAGES):
        rate, moved = rates[stage], change[stage]
        for axis in range(3):
            rate[axis] = start[3 + axis] + moved[3 + axis]
        if contact.turning:
            half = 0.5 / contact.physics.inertia
            x, y, z = half * (start[6] + moved[6]), half * (start[7] + moved[7]), half * (start[8] + moved[8])
            a, b, c, d = start[9] + moved[9], start[10] + moved[10], start[11] + moved[11], start[12] + moved[12]
            rate[9], rate[10], rate[11], rate[12] = quaternion_rate(x, y, z, a, b, c, d)
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
