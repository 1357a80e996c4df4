"""The explicit Runge-Kutta method of order 8 with error estimates of order 5 and 3, by Dormand and Prince.

The coefficients are those of the program DOP853: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I,
2nd edition, section II.5. Systems here do not depend on time, so that the nodes c_i are not needed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.state import Physics
from stiffdice.integrators.event_driven.active_set import SIZE, derivative

STAGES = 12
ORDER = 8

# (row, stage, coefficient), those that are not zero: a row for each stage, then the step's, then the error's.
_COEFFICIENTS = (
    (1, 0, 0.05260015195876773),
    (2, 0, 0.0197250569845379),
    (2, 1, 0.0591751709536137),
    (3, 0, 0.02958758547680685),
    (3, 2, 0.08876275643042054),
    (4, 0, 0.2413651341592667),
    (4, 2, -0.8845494793282861),
    (4, 3, 0.924834003261792),
    (5, 0, 0.037037037037037035),
    (5, 3, 0.17082860872947386),
    (5, 4, 0.12546768756682242),
    (6, 0, 0.037109375),
    (6, 3, 0.17025221101954405),
    (6, 4, 0.06021653898045596),
    (6, 5, -0.017578125),
    (7, 0, 0.03709200011850479),
    (7, 3, 0.17038392571223998),
    (7, 4, 0.10726203044637328),
    (7, 5, -0.015319437748624402),
    (7, 6, 0.008273789163814023),
    (8, 0, 0.6241109587160757),
    (8, 3, -3.3608926294469414),
    (8, 4, -0.868219346841726),
    (8, 5, 27.59209969944671),
    (8, 6, 20.154067550477894),
    (8, 7, -43.48988418106996),
    (9, 0, 0.47766253643826434),
    (9, 3, -2.4881146199716677),
    (9, 4, -0.590290826836843),
    (9, 5, 21.230051448181193),
    (9, 6, 15.279233632882423),
    (9, 7, -33.28821096898486),
    (9, 8, -0.020331201708508627),
    (10, 0, -0.9371424300859873),
    (10, 3, 5.186372428844064),
    (10, 4, 1.0914373489967295),
    (10, 5, -8.149787010746927),
    (10, 6, -18.52006565999696),
    (10, 7, 22.739487099350505),
    (10, 8, 2.4936055526796523),
    (10, 9, -3.0467644718982196),
    (11, 0, 2.273310147516538),
    (11, 3, -10.53449546673725),
    (11, 4, -2.0008720582248625),
    (11, 5, -17.9589318631188),
    (11, 6, 27.94888452941996),
    (11, 7, -2.8589982771350235),
    (11, 8, -8.87285693353063),
    (11, 9, 12.360567175794303),
    (11, 10, 0.6433927460157636),
    (12, 0, 0.054293734116568765),
    (12, 5, 4.450312892752409),
    (12, 6, 1.8915178993145003),
    (12, 7, -5.801203960010585),
    (12, 8, 0.3111643669578199),
    (12, 9, -0.1521609496625161),
    (12, 10, 0.20136540080403034),
    (12, 11, 0.04471061572777259),
    (13, 0, 0.01312004499419488),
    (13, 5, -1.2251564463762044),
    (13, 6, -0.4957589496572502),
    (13, 7, 1.6643771824549864),
    (13, 8, -0.35032884874997366),
    (13, 9, 0.3341791187130175),
    (13, 10, 0.08192320648511571),
    (13, 11, -0.022355307863886294),
)

_TABLE = np.zeros((STAGES + 2, STAGES))
for _row, _stage, _value in _COEFFICIENTS:
    _TABLE[_row, _stage] = _value

# Stage i is evaluated at y + h Σ_j COUPLING[i, j] k_j, and the step is h Σ_i WEIGHTS[i] k_i.
COUPLING, WEIGHTS = _TABLE[:STAGES], _TABLE[STAGES]

# h Σ_i ERROR_5[i] k_i and h Σ_i ERROR_3[i] k_i estimate the errors of embedded methods of order 5 and 3.
ERROR_5, ERROR_3 = _TABLE[STAGES + 1], WEIGHTS.copy()
ERROR_3[[0, 8, 11]] -= 0.24409448818897638, 0.7338466882816118, 0.022058823529411766


@njit
def step(
    turning: bool,
    physics: Physics,
    nodes: Any,
    regime: Any,
    start: Any,
    h: float,
    stages: Any,
    end: Any,
) -> None:
    """Set `end` to the motion `start` after h [s] in a regime; stages: shape (13, SIZE), the first is start's rate.

    Evaluates 11 derivatives; row 12 of `stages` is left for the end's.
    """
    for stage in range(1, STAGES):
        _combine(COUPLING[stage], stage, stages, start, h, end)
        derivative(turning, physics, nodes, regime, end, stages[stage])
    _combine(WEIGHTS, STAGES, stages, start, h, end)


@njit
def _combine(weights: Any, count: int, stages: Any, start: Any, h: float, end: Any) -> None:
    """Set `end` to start + h Σ_i weights[i] stages[i]."""
    # Four sums at a time: they stay in registers, and the compiler makes vectors of them.
    for part in range(0, SIZE, 4):
        a = b = c = d = 0.0
        for stage in range(count):
            weight = weights[stage]
            a += weight * stages[stage, part]
            b += weight * stages[stage, part + 1]
            c += weight * stages[stage, part + 2]
            d += weight * stages[stage, part + 3]
        end[part] = start[part] + h * a
        end[part + 1] = start[part + 1] + h * b
        end[part + 2] = start[part + 2] + h * c
        end[part + 3] = start[part + 3] + h * d


@njit
def error(stages: Any, scale: Any, h: float, nothing: Any, sums: Any) -> float:
    """Return the estimated error of the step over what is tolerated, `scale` of each part of the motion.

    As in DOP853, the fifth-order estimate reined in by the third-order one: err5²/√(err5² + err3²/100).
    nothing: zeros, shape (SIZE,). sums: scratch, shape (2, SIZE).
    """
    _combine(ERROR_5, STAGES, stages, nothing, h, sums[0])
    _combine(ERROR_3, STAGES, stages, nothing, h, sums[1])
    fifth = third = total = 0.0
    for part in range(SIZE):
        fifth = max(fifth, abs(sums[0, part]) / scale[part])
        third = max(third, abs(sums[1, part]) / scale[part])
        total += sums[0, part]
    if not math.isfinite(total):
        return math.inf
    if fifth == 0.0:
        return 0.0
    return fifth * fifth / math.sqrt(fifth * fifth + 0.01 * third * third)
