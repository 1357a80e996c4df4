"""Whether verdicts follow from the measures that they judge."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.archive.consistency.tolerance import outside
from stiffdice.simulation.criteria.judge import ending, judge
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.outcome import Verdict

# How a run may have ended that its measures do not show.
ENDINGS = (Verdict.UNRESOLVED, Verdict.SANK, Verdict.STALLED, Verdict.UNDECIDED)


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
