"""The sweep that shards add up to, and the edges found in it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.archive.consistency.tolerance import ROUNDING, outside, unequal
from stiffdice.io.cf_enums import meanings_of
from stiffdice.sweep import stability_limits


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
    """Return a line for all that a sweep says otherwise than its shards, which it does to the last bit.

    Of the runs no more is asked than of the sweep.
    """
    whole, runs = (json.loads(str(found.attrs.get("config", "{}"))) for found in (dataset, again))
    said = _said_otherwise(dataset.attrs, again.attrs, _SHARED, "its shards")
    return said + _said_otherwise(whole, runs, runs, "its shards", "config.") + _differences(dataset, again, {})


def _said_otherwise(
    said: Mapping[str, Any], right: Mapping[str, Any], names: Iterable[str], whose: str, above: str = ""
) -> list[str]:
    return [
        f"{above}{name} = {said.get(name)}: allowed is {right.get(name)}, that of {whose}"
        for name in names
        if str(said.get(name)) != str(right.get(name))
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
    said = _said_otherwise(dataset.attrs, collected.attrs, (*_SHARED, "config_digest"), "its sweep")
    return said + _differences(dataset, again, rooms)


def _differences(dataset: xr.Dataset, again: xr.Dataset, rooms: Mapping[Any, npt.ArrayLike]) -> list[str]:
    found = []
    for name, right in again.variables.items():
        given = dataset.variables.get(name)
        if given is None:
            found.append(f"{name}: is missing")
        elif given.sizes != right.sizes or given.dims != right.dims:
            found.append(f"{name}{dict(given.sizes)}: allowed is {dict(right.sizes)}")
        elif given.attrs.get("flag_meanings") != right.attrs.get("flag_meanings"):
            found.append(f"{name}: flag_meanings: allowed are {right.attrs.get('flag_meanings')}")
        else:
            found += unequal(str(name), given.values, right.values, rooms.get(name, 0.0), "computed again")
    return found
