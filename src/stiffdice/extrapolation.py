"""The linearly implicit Euler method, extrapolated: for motions with friction that all but holds.

Regularised friction pulls a slow node's slip to nearly nothing within about cutoff/(μ × its acceleration), some 1e-6 of
a bounce. With A and B the slopes of the accelerations a in the velocities u and in the place x, a base step of h is
u' = u + h (1 − hA − h²B)⁻¹ (a + hB u), x' = x + h u'. B must be there, though springs alone are slow: the slip that a
node gets by being turned would soon be more than friction's cutoff. The end of the step expands in powers of h, and
Aitken and Neville's extrapolation of the results of 1, 2, ..., COLUMNS base steps leaves an error of order COLUMNS + 1
(Deuflhard 1985, doi:10.1137/1027140; Hairer and Wanner, Solving Ordinary Differential Equations II, IV.9).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stiffdice.compiled import njit
from stiffdice.regime import SIZE, derivative, slopes
from stiffdice.state import Physics

COLUMNS = 7
ORDER = COLUMNS - 1  # of the error estimate
EVALUATIONS = COLUMNS * (COLUMNS + 1) // 2 - COLUMNS  # the first of each row is the start's

# By about how much extrapolation blows up the round-off of the forces.
NOISE = 64


@njit
def step(
    turning: bool,
    physics: Physics,
    nodes: Any,
    regime: Any,
    start: Any,
    rate: Any,
    h: float,
    table: Any,
    end: Any,
    scale: Any,
) -> float:
    """Set `end` to the motion `start` after h [s] in a regime; return the estimated error over what is tolerated.

    rate: start's derivative. table: scratch, shape (COLUMNS, SIZE). scale: what is tolerated of each part.
    """
    by_speed, by_place, factors, moving = np.empty((6, 6)), np.empty((6, 6)), np.empty((6, 6)), np.empty(SIZE)
    unknowns = 6 if turning else 3
    slopes(turning, physics, nodes, regime, start, by_speed, by_place)
    for row in range(COLUMNS):
        count = row + 1
        _factorise(by_speed, by_place, h / count, unknowns, factors)
        # Changes are kept apart from where they start, or extrapolation would blow up the latter's round-off.
        for part in range(SIZE):
            table[row, part], end[part], moving[part] = 0.0, start[part], rate[part]
        for base in range(count):
            if base > 0:
                derivative(turning, physics, nodes, regime, end, moving)
            _base_step(turning, physics, end, moving, h / count, by_place, factors, unknowns)
            for part in range(SIZE):
                table[row, part] += moving[part]
                end[part] = start[part] + table[row, part]
    return _extrapolate(table, start, end, scale)


@njit
def _factorise(by_speed: Any, by_place: Any, h: float, unknowns: int, factors: Any) -> None:
    """Set `factors` to the triangles of 1 − hA − h²B; it needs no pivots, being all but positive definite."""
    for i in range(unknowns):
        for j in range(unknowns):
            factors[i, j] = (1.0 if i == j else 0.0) - h * (by_speed[i, j] + h * by_place[i, j])
    for i in range(unknowns):
        for row in range(i + 1, unknowns):
            factors[row, i] /= factors[i, i]
            for j in range(i + 1, unknowns):
                factors[row, j] -= factors[row, i] * factors[i, j]


@njit
def _base_step(
    turning: bool, physics: Physics, motion: Any, rate: Any, h: float, by_place: Any, factors: Any, unknowns: int
) -> None:
    """Turn a motion's rate into its change in h [s]: of velocities implicitly, of place and turn with the new ones."""
    for i in range(unknowns):
        for j in range(unknowns):
            rate[3 + i] += h * by_place[i, j] * motion[3 + j]
    for i in range(unknowns):
        for j in range(i):
            rate[3 + i] -= factors[i, j] * rate[3 + j]
    for i in range(unknowns - 1, -1, -1):
        for j in range(i + 1, unknowns):
            rate[3 + i] -= factors[i, j] * rate[3 + j]
        rate[3 + i] /= factors[i, i]
    for i in range(unknowns):
        rate[3 + i] *= h
    for axis in range(3):
        rate[axis] = h * (motion[3 + axis] + rate[3 + axis])
    if turning:
        half = h / 2 / physics.inertia
        x, y, z = half * (motion[6] + rate[6]), half * (motion[7] + rate[7]), half * (motion[8] + rate[8])
        a, b, c, d = motion[9], motion[10], motion[11], motion[12]
        rate[9] = -x * b - y * c - z * d
        rate[10] = x * a + y * d - z * c
        rate[11] = y * a + z * b - x * d
        rate[12] = z * a + x * c - y * b


@njit
def _extrapolate(table: Any, start: Any, end: Any, scale: Any) -> float:
    """Set `end` to the limit of no step size at all, and return the change by the last column over the scale."""
    error = 0.0
    for part in range(SIZE):
        for column in range(1, COLUMNS):
            for row in range(COLUMNS - 1, column - 1, -1):
                change = (table[row, part] - table[row - 1, part]) * ((row + 1 - column) / column)
                table[row, part] += change
                if column == COLUMNS - 1:
                    error = max(error, abs(change) / scale[part])
        end[part] = start[part] + table[COLUMNS - 1, part]
        if not math.isfinite(end[part]):
            return math.inf
    return error
