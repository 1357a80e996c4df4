"""Whether verdicts follow from the measures that they judge."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy.typing as npt
import xarray as xr

from stiffdice.archive.consistency.tolerance import outside
from stiffdice.simulation.criteria.judge import ending, judge
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.outcome import Verdict

# How a run may have ended that its measures do not show.
ENDINGS = (Verdict.UNRESOLVED, Verdict.SANK, Verdict.STALLED, Verdict.UNDECIDED)


# How far a limit in a text of six digits may be from the number that it stands for, relative to it.
_SIX_DIGITS = 5e-6

Limits = tuple[dict[str, float], dict[str, float]]  # tolerances of the criteria asked, by name: at least and at most


def limits_in(text: str) -> Limits:
    """Return the limits in a file's attribute `criteria`; raises ValueError if it says something else."""
    least, most = {}, {}
    for part in text.split("; "):
        told = re.fullmatch(r"(\w+): (\w+) <= (\S+)", part)
        if told is None or told[1] not in CRITERIA or told[2] != CRITERIA[told[1]].MEASURE:
            raise ValueError(f"criteria = {text!r}: allowed are parts such as energy: energy_ratio <= 1.05")
        limit, base = float(told[3]), CRITERIA[told[1]].BASE
        least[told[1]], most[told[1]] = limit * (1 - _SIX_DIGITS) - base, limit * (1 + _SIX_DIGITS) - base
    return least, most


def problems(dataset: xr.Dataset, measures: Mapping[str, npt.ArrayLike], limits: Limits | None) -> list[str]:
    """Return a line if a verdict or an ending is not what the measures, all of its shape, give.

    limits: None if it is not known which criteria were asked; then a verdict is at least how its run ended.
    """
    stored = dataset["verdict"].values
    ended = dataset["ending"].values if "ending" in dataset else stored  # not in files of before it was stored
    right = ending(measures, {name: ended == name for name in ENDINGS})
    found = outside("ending", ended, ended == right, "what the measures say, or graver") if "ending" in dataset else []
    if limits is None:
        bad = (right != Verdict.PASSED) & (right != Verdict.UNRESOLVED)  # graver than any criterion
        return found + outside("verdict", stored, ~bad | (stored == right), "how the run ended")
    strict, lenient = (judge(tolerances, measures, right) for tolerances in limits)
    return found + outside("verdict", stored, (stored == strict) | (stored == lenient), "what its measures say")
