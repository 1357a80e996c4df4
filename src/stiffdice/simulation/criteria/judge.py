"""From measures, and from how a run ended, to a verdict: what it means to pass, for one run and for those of a cell."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from stiffdice.simulation.criteria.registry import CRITERIA, holds
from stiffdice.simulation.outcome import BLOW_UP, Verdict, gravest


def ending(measures: Mapping[str, npt.ArrayLike], endings: Mapping[Verdict, npt.ArrayLike]) -> npt.NDArray[np.int8]:
    """Return how each run ended whatever it is asked, a Verdict, int8; PASSED where nothing speaks against it.

    measures: values by name. endings: whether a run ended so, by verdict. Arrays are all of one shape, the result's.
    """
    ratio = np.asarray(measures["energy_ratio"])
    out_of_range = (np.asarray(measures["out_of_range"]) > 0) | np.isnan(ratio)
    return gravest({**endings, Verdict.BLEW_UP: ratio > BLOW_UP, Verdict.LEFT_NUMERIC_RANGE: out_of_range})


def passes(
    tolerances: Mapping[str, float], measures: Mapping[str, npt.ArrayLike], endings: npt.ArrayLike
) -> npt.NDArray[np.bool_]:
    """Return whether each criterion asked holds of a run that ended well, shape (criterion, ...).

    tolerances: of the criteria asked. measures: values by name. endings: as `ending` returns them.
    """
    well = np.asarray(endings) == Verdict.PASSED
    return np.stack(
        [well & holds(name, measures[CRITERIA[name].MEASURE], tolerance) for name, tolerance in tolerances.items()]
    )


def judge(
    tolerances: Mapping[str, float], measures: Mapping[str, npt.ArrayLike], endings: npt.ArrayLike
) -> npt.NDArray[np.int8]:
    """Return the Verdict of each run, int8: the gravest of the criteria it breaks and of how it ended.

    It is PASSED where `passes` says so of every criterion asked. Arguments as there.
    """
    ended = np.asarray(endings)
    applies: dict[Verdict, npt.NDArray[np.bool_]] = {
        verdict: ended == verdict for verdict in Verdict if verdict != Verdict.PASSED
    }
    for name, tolerance in tolerances.items():
        fails = ~holds(name, measures[CRITERIA[name].MEASURE], tolerance)
        applies[CRITERIA[name].FAILURE] = applies[CRITERIA[name].FAILURE] | fails
    return gravest(applies)
