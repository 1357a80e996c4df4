"""Many runs: shards, the sweep that they add up to, and the edges found in it."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.archive.consistency import verdicts
from stiffdice.archive.consistency.tolerance import ROUNDING, outside, unequal
from stiffdice.io.cf_enums import meanings_of
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.sweep import stability_limits


def of_runs(dataset: xr.Dataset) -> list[str]:
    """Return a line for everything in a shard, or in some cells of one, that cannot be so."""
    steps, done = dataset["steps"].values[:, None], dataset["steps_done"].values
    cells = np.rec.fromarrays([dataset[name].values for name in ("contact", "stiffness", "steps")])
    once = np.isin(np.arange(len(cells)), np.unique(cells, return_index=True)[1])
    # The limits of the criteria, where the runs were asked any.
    limits = verdicts.limits_in(str(dataset.attrs["criteria"])) if "criteria" in dataset.attrs else None
    measures = {criterion.MEASURE: dataset[criterion.MEASURE].values for criterion in CRITERIA.values()}
    return [
        *outside("steps", steps[:, 0], once, "a cell that is not there already"),
        *outside("steps_done", done, (done >= 0) & (done <= steps), "a number from 0 to steps"),
        *verdicts.problems(dataset, measures, limits),
    ]


def of_cells(dataset: xr.Dataset) -> list[str]:
    """Return a line for every count in a collected sweep that cannot be so."""
    members, failing, counts = int(dataset.attrs["members"]), dataset["failing"].values, dataset["verdicts"].values
    passed = counts[:, meanings_of(dataset["verdict"]).index("passed")]
    most = members - failing.max(axis=0)
    return [
        *outside("failing", failing, (failing >= 0) & (failing <= members), f"a number from 0 to {members}"),
        *unequal("sum of verdicts", counts.sum(axis=1), members, 0.0, "the members of a cell"),
        *outside("verdicts of passed", passed, passed <= most, "at most the members that fail no criterion"),
    ]


# Of the logarithms (base 10) through which a power law goes: a hundred terms of a size up to 20, twice rounded.
_FIT_ROUNDING = 100 * 20 * 2 * ROUNDING


# What a file and the one that it is made from say alike.
_SHARED = (
    *("scene_digest", "model", "scheme", "simulator", "simulator_version", "code_digest", "early_stop"),
    *("members", "runs_digest"),
)


def same_as_collected(dataset: xr.Dataset, again: xr.Dataset) -> list[str]:
    """Return a line for all that a sweep says otherwise than its shards, which it does to the last bit."""
    return (
        _attributes(dataset, again, "its shards", _SHARED) + _config(dataset, again) + _differences(dataset, again, {})
    )


def _config(dataset: xr.Dataset, again: xr.Dataset) -> list[str]:
    """Return a line for all that was asked of the runs otherwise than of the sweep, which asks more."""
    whole, runs = (json.loads(str(found.attrs.get("config", "{}"))) for found in (dataset, again))
    return [
        f"config.{key} = {whole.get(key)}: allowed is {value}, that of its shards"
        for key, value in runs.items()
        if whole.get(key) != value
    ]


def _attributes(dataset: xr.Dataset, other: xr.Dataset, whose: str, names: Sequence[str]) -> list[str]:
    return [
        f"{name} = {dataset.attrs.get(name)}: allowed is {other.attrs.get(name)}, that of {whose}"
        for name in names
        if str(dataset.attrs.get(name)) != str(other.attrs.get(name))
    ]


def same_as_found(dataset: xr.Dataset, collected: xr.Dataset) -> list[str]:
    """Return a line for every variable of a frontier that is not what its sweep says.

    Counts and edges are equal; power laws to the rounding of their sums, as libraries add in other orders.
    """
    with np.errstate(all="ignore"):
        again = stability_limits.find(collected)
    rooms: dict[str, npt.ArrayLike] = dict.fromkeys(stability_limits.FIT, _FIT_ROUNDING)
    for name in ("factor", "centre"):
        rooms[name] = np.log(10) * _FIT_ROUNDING * np.abs(again[name].values)
    for name in ("limit", "pass_fraction_low", "pass_fraction_high"):
        rooms[name] = 16 * ROUNDING * np.abs(again[name].values) + 4 * ROUNDING
    shared = (*_SHARED, "config_digest")
    return _attributes(dataset, collected, "its sweep", shared) + _differences(dataset, again, rooms)


def _differences(dataset: xr.Dataset, again: xr.Dataset, rooms: dict[str, npt.ArrayLike]) -> list[str]:
    found = []
    for key, right in again.variables.items():
        name = str(key)
        if name not in dataset.variables:
            found.append(f"{name}: is missing")
        elif dataset[name].dims != right.dims or dataset[name].shape != right.shape:
            found.append(f"{name}{dict(dataset[name].sizes)}: allowed is {dict(right.sizes)}")
        elif dataset[name].attrs.get("flag_meanings") != right.attrs.get("flag_meanings"):
            found.append(f"{name}: flag_meanings: allowed are {right.attrs.get('flag_meanings')}")
        else:
            found += unequal(name, dataset[name].values, right.values, rooms.get(name, 0.0), "computed again")
    return found
