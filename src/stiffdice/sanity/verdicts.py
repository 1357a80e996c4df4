"""Whether verdicts follow from the measures that they judge."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.criteria import CRITERIA
from stiffdice.judge import ending, judge
from stiffdice.sanity.bounds import outside
from stiffdice.verdict import SEVERITY, Verdict

# How a run may have ended that its measures do not show.
ENDINGS = (Verdict.UNRESOLVED, Verdict.SANK, Verdict.STALLED, Verdict.UNDECIDED)

# Of a run that ended early: that a budget was spent, or what is graver.
_EARLY = SEVERITY[SEVERITY.index(Verdict.UNDECIDED) :]

_GRAVITY = np.array([SEVERITY.index(verdict) for verdict in Verdict])


class Limits(NamedTuple):
    """Tolerances of the criteria asked, by name; a text says six digits of base + tolerance, so at least and most."""

    least: dict[str, float]
    most: dict[str, float]


def limits_in(text: str) -> Limits:
    """Return the limits in a file's attribute `criteria`; raises ValueError if it says something else."""
    limits = Limits({}, {})
    for part in text.split("; "):
        told = re.fullmatch(r"(\w+): (\w+) <= (\S+)", part)
        if told is None or told[1] not in CRITERIA or told[2] != CRITERIA[told[1]].MEASURE:
            raise ValueError(f"criteria = {text!r}: allowed are parts such as energy: energy_ratio <= 1.05")
        limit, base = float(told[3]), CRITERIA[told[1]].BASE
        half = 0.5 * 10.0 ** (np.floor(np.log10(limit)) - 5) if limit > 0 else 0.0
        limits.least[told[1]], limits.most[told[1]] = limit - half - base, limit + half - base
    return limits


def of_measures(measures: Mapping[str, npt.ArrayLike]) -> list[str]:
    """Return a line for every measure that is out of its range, all of one shape."""
    found = []
    for name, given in measures.items():
        measure = np.asarray(given)
        if name == "out_of_range":
            found += outside(name, measure, np.isin(measure, [0.0, 1.0]), "0 or 1")
        else:
            found += outside(name, measure, (measure >= 0) | np.isnan(measure), "a number >= 0, or none")
    return found


def problems(
    verdict: npt.ArrayLike, endings: npt.ArrayLike | None, measures: Mapping[str, npt.ArrayLike], limits: Limits | None
) -> list[str]:
    """Return a line for every verdict that measures and ending do not give, all of one shape.

    endings: None in files of before they were stored. limits: None if it is not known which criteria were asked; then
    only what judges every run is looked at.
    """
    stored = np.asarray(verdict)
    ended = stored if endings is None else np.asarray(endings)
    right = ending(measures, {name: ended == name for name in ENDINGS})
    found = [] if endings is None else outside("ending", ended, ended == right, "what the measures say, or graver")
    if limits is None:
        well = (right == Verdict.PASSED) | (right == Verdict.UNRESOLVED)
        none = ~np.isin(stored, [Verdict.PASSED, *_ALWAYS]) | (stored == right)
        fine = np.where(well, none, stored == right)
        found += outside("verdict", stored, fine, "how the run ended, if that is graver than any criterion")
        return found + _sorted_by(stored, measures)
    strict, lenient = (judge(tolerances, measures, right) for tolerances in limits)
    fine = (stored == strict) | (stored == lenient)
    return found + outside("verdict", stored, fine, _allowed(stored, strict, fine))


_ALWAYS = (*ENDINGS, Verdict.BLEW_UP, Verdict.LEFT_NUMERIC_RANGE)


def _sorted_by(stored: npt.NDArray[np.int8], measures: Mapping[str, npt.ArrayLike]) -> list[str]:
    """Whatever the limit of a criterion is: who fails it measures more than any whose verdict is milder."""
    found = []
    for criterion in CRITERIA.values():
        measure, fails = np.asarray(measures[criterion.MEASURE]), stored == criterion.FAILURE
        milder = ~np.isnan(measure) & (_GRAVITY[stored] < _GRAVITY[criterion.FAILURE])
        most = np.max(measure, where=milder, initial=-np.inf)
        allowed = f"another verdict, as its {criterion.MEASURE} is no more than that of a milder one, {most:.17g}"
        found += outside("verdict", stored, ~(fails & (measure <= most)), allowed)
    return found


def _allowed(stored: npt.NDArray[np.int8], right: npt.NDArray[np.int8], fine: npt.NDArray[np.bool_]) -> str:
    """Say what the first verdict that is wrong should be."""
    wrong = np.argwhere(~fine)
    first = int(right[tuple(wrong[0])]) if len(wrong) else 0
    return f"{first}, {Verdict(first).name.lower()}, as its measures and its ending say"


def early(
    steps_done: npt.ArrayLike, steps: npt.ArrayLike, verdict: npt.ArrayLike, decided: npt.ArrayLike = False
) -> list[str]:
    """Return a line for every run that ended early and does not say why, or says so and did not.

    decided: whether all criteria that may end a run were decided.
    """
    done, stored = np.asarray(steps_done), np.asarray(verdict)
    reasons = np.isin(stored, _EARLY) | np.asarray(decided, bool)
    found = outside("verdict", stored, (done < steps) | (stored != Verdict.UNDECIDED), "undecided only before the end")
    why = "all of the run's steps, or a reason to end earlier"
    return found + outside("steps_done", done, (done == steps) | reasons, why)
