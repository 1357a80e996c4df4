"""From measures to a verdict."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from stiffdice.criteria import CRITERIA, holds
from stiffdice.verdict import BLOW_UP, Verdict, gravest


def judge(
    tolerances: Mapping[str, float],
    measures: Mapping[str, npt.ArrayLike],
    endings: Mapping[Verdict, npt.ArrayLike],
) -> npt.NDArray[np.int8]:
    """Return the Verdict of each run, int8: the gravest of the criteria it breaks and of how it ended.

    tolerances: of the criteria asked. measures: values by name. endings: whether a run ended so, by verdict.
    Arrays are all of one shape, which is the result's.
    """
    ratio = np.asarray(measures["energy_ratio"])
    applies = dict(endings)
    for name, tolerance in tolerances.items():
        applies[CRITERIA[name].FAILURE] = ~holds(name, measures[CRITERIA[name].MEASURE], tolerance)
    applies[Verdict.BLEW_UP] = ratio > BLOW_UP
    applies[Verdict.LEFT_NUMERIC_RANGE] = (np.asarray(measures["out_of_range"]) > 0) | np.isnan(ratio)
    return gravest(applies)
