"""The explicit Runge-Kutta method of order 8 with error estimates of order 5 and 3, by Dormand and Prince.

The coefficients are those of the program DOP853: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I,
2nd edition, section II.5. Systems here do not depend on time, so that the nodes c_i are not needed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stiffdice.dynamics.compilation import njit
from stiffdice.integrators.event_driven.active_set import SIZE, Contact, derivative

STAGES = 12
ORDER = 8

# What stages 1 to 11, the step and the error take of the stages before: row by row, from the first stage on.
_ROWS = """
0.05260015195876773,
0.0197250569845379 0.0591751709536137,
0.02958758547680685 0 0.08876275643042054,
0.2413651341592667 0 -0.8845494793282861 0.924834003261792,
0.037037037037037035 0 0 0.17082860872947386 0.12546768756682242,
0.037109375 0 0 0.17025221101954405 0.06021653898045596 -0.017578125,
0.03709200011850479 0 0 0.17038392571223998 0.10726203044637328 -0.015319437748624402 0.008273789163814023,
0.6241109587160757 0 0 -3.3608926294469414 -0.868219346841726 27.59209969944671 20.154067550477894 -43.48988418106996,
0.47766253643826434 0 0 -2.4881146199716677 -0.590290826836843 21.230051448181193 15.279233632882423
-33.28821096898486 -0.020331201708508627,
-0.9371424300859873 0 0 5.186372428844064 1.0914373489967295 -8.149787010746927 -18.52006565999696 22.739487099350505
2.4936055526796523 -3.0467644718982196,
2.273310147516538 0 0 -10.53449546673725 -2.0008720582248625 -17.9589318631188 27.94888452941996 -2.8589982771350235
-8.87285693353063 12.360567175794303 0.6433927460157636,
0.054293734116568765 0 0 0 0 4.450312892752409 1.8915178993145003 -5.801203960010585 0.3111643669578199
-0.1521609496625161 0.20136540080403034 0.04471061572777259,
0.01312004499419488 0 0 0 0 -1.2251564463762044 -0.4957589496572502 1.6643771824549864 -0.35032884874997366
0.3341791187130175 0.08192320648511571 -0.022355307863886294
"""
_TABLE = np.zeros((STAGES + 2, STAGES))
for _row, _numbers in enumerate(_ROWS.split(","), start=1):
    _TABLE[_row, : len(_numbers.split())] = [float(number) for number in _numbers.split()]

# Stage i is evaluated at y + h Σ_j COUPLING[i, j] k_j, and the step is h Σ_i WEIGHTS[i] k_i.
COUPLING, WEIGHTS = _TABLE[:STAGES], _TABLE[STAGES]

# h Σ_i ERROR_5[i] k_i and h Σ_i ERROR_3[i] k_i estimate the errors of embedded methods of order 5 and 3.
ERROR_5, ERROR_3 = _TABLE[STAGES + 1], WEIGHTS.copy()
ERROR_3[[0, 8, 11]] -= 0.24409448818897638, 0.7338466882816118, 0.022058823529411766


@njit
def step(contact: Contact, start: Any, h: float, stages: Any, end: Any) -> None:
    """Set `end` to the motion `start` after h [s] in a regime; stages: shape (13, SIZE), the first is start's rate.

    Evaluates 11 derivatives; row 12 of `stages` is left for the end's.
    """
    for stage in range(1, STAGES):
        _combine(COUPLING[stage], stage, stages, start, h, end)
        derivative(contact, end, stages[stage])
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
