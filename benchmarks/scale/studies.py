"""The same physics in fewer runs or in more: studies that are made from one that is given, as plain data."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from typing import Any

from stiffdice.errors import InputError
from stiffdice.scene import validation
from stiffdice.study.config import Study
from stiffdice.sweep.grid import Sweep

# An extension adds so much of a decade of harder grounds, as dense as those before, and so many of a scan's steps again
# in the middle of the scan, on the scale of logarithms from `_AMID[0]` to `_AMID[1]` of it.
_DECADES = 0.5
_AMID = (0.25, 0.75)


def runs_of(study: Study) -> int:
    """Return how many runs a study's sweeps make, without those that refined scans add."""
    return sum(_cells_of(sweep) * sweep.members for sweep in study.sweeps.values())


def _cells_of(sweep: Sweep) -> int:
    return sum(len(sweep.scan(column)) for column in sweep.columns())


def of_size(data: Mapping[str, Any], share: float) -> dict[str, Any]:
    """Return a study with about this share of the stiffnesses of each sweep, and all else as it is.

    They are the middles of equal parts of the span (in the logarithm), so that few cost as much each as many do.
    Raises InputError for a sweep whose stiffness is no one span.
    """
    sized = copy.deepcopy(dict(data))
    for name, sweep in sized.get("sweeps", {}).items():
        span = _span(sweep, name, "stiffness")
        count = max(1, round(share * span["count"]))
        if count != span["count"]:
            low, high = math.log10(span["from"]), math.log10(span["to"])
            half = (high - low) / count / 2
            sweep["stiffness"] = {"from": 10 ** (low + half), "to": 10 ** (high - half), "count": count}
    return sized


def extended(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return a study with harder grounds and denser steps in each sweep: a further span of each.

    Raises InputError for a sweep whose stiffness or steps are no one span.
    """
    wider = copy.deepcopy(dict(data))
    for name, sweep in wider.get("sweeps", {}).items():
        grounds = _span(sweep, name, "stiffness")
        last, decades = math.log10(grounds["to"]), math.log10(grounds["to"] / grounds["from"])
        spacing = decades / max(1, grounds["count"] - 1) or _DECADES
        count = max(1, round(_DECADES / spacing))
        harder = {"from": 10 ** (last + spacing), "to": 10 ** (last + count * spacing), "count": count}
        sweep["stiffness"] = [grounds, harder]
        key = "steps" if "steps" in sweep else "omega_h"
        steps = _span(sweep, name, key)
        low, high = math.log10(steps["from"]), math.log10(steps["to"])
        ends = [10 ** (low + part * (high - low)) for part in _AMID]
        sweep[key] = [steps, {"from": ends[0], "to": ends[1], "count": max(2, steps["count"] // 2)}]
    return wider


def _span(sweep: Mapping[str, Any], name: str, key: str) -> Mapping[str, Any]:
    span = sweep[key]
    if not isinstance(span, Mapping):
        raise InputError(
            f"sweeps.{name}.{key} = {validation.shown(span)}: to be made smaller it has to be {{from, to, count}}"
        )
    return span
