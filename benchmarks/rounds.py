"""Take the times: round after round in which the cases take turns, so that a slow moment of the machine hits all."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.case import Case
from stiffdice.dynamics.state import Array
from stiffdice.experiments.timing import SHORTEST, seconds_of


def measured(cases: Sequence[Case], rounds: int, tell: Callable[[str], None] = lambda text: None) -> Array:
    """Return the wall time of one `per` of each case in each round [s], shape (case, round).

    NaN in the rounds in which a case has no turn; its turns are spread over all of them. tell: is told what comes.
    """
    repeats = [1 if case.fresh else _warmed(case, tell) for case in cases]
    samples = np.full((len(cases), rounds), np.nan)
    gc.disable()
    try:
        for number in range(rounds):
            gc.collect()
            for k, case in enumerate(cases):
                if due(number, min(case.times, rounds), rounds):
                    tell(f"round {number + 1} of {rounds}: {case.what}")
                    samples[k, number] = seconds_of(case.prepare(), repeats[k]) / case.amount
    finally:
        gc.enable()
    return samples


def due(number: int, times: int, rounds: int) -> bool:
    """Return whether a case that has so many turns has one in round `number`; the first round is one for all."""
    return times > 0 and (number == 0 or number * times // rounds > (number - 1) * times // rounds)


def _warmed(case: Case, tell: Callable[[str], None]) -> int:
    """Call a case for the first time, and return how often to call it in a row so that a clock can tell."""
    tell(case.what)
    case.prepare()()
    return math.ceil(SHORTEST / max(seconds_of(case.prepare()), 1e-9))
