"""Many runs: shards, the sweep that they add up to, and the edges found in it."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice import frontier, theory
from stiffdice.criteria import CRITERIA
from stiffdice.io.enums import meanings_of
from stiffdice.sanity import verdicts
from stiffdice.sanity.bounds import ROUNDING, outside, unequal
from stiffdice.sanity.runs import scene_of
from stiffdice.state import Array
from stiffdice.verdict import Verdict


def of_runs(dataset: xr.Dataset) -> list[str]:
    """Return a line for everything in a shard, or in some cells of one, that cannot be so."""
    _, found = scene_of(dataset)
    found += _cells(dataset)
    steps, verdict = dataset["steps"].values[:, None], dataset["verdict"].values
    done, computed, decided = (dataset[name].values for name in ("steps_done", "steps_computed", "decided"))
    # A step that leaves the range of doubles is computed and not done.
    left = (verdict == Verdict.LEFT_NUMERIC_RANGE).astype(np.int64)
    found += outside("steps_done", done, (done >= 0) & (done <= steps), "a number from 0 to steps")
    found += outside("steps_computed", computed, (computed >= 0) & (computed <= done + left), "from 0 to steps_done")
    found += outside("decided", decided, (decided >= 0) & (decided <= (done + left)[..., None]), "from 0 to steps_done")
    phase = dataset["touchdown_phase"].values
    fine = ((phase > 0) & (phase <= 1)) | np.isnan(phase)
    found += outside("touchdown_phase", phase, fine, "a number above 0, at most 1, or none")
    measures = _measures(dataset)
    found += verdicts.of_measures(measures)
    limits = _limits(dataset)
    found += verdicts.problems(verdict, dataset["ending"].values if "ending" in dataset else None, measures, limits)
    return found + _early(dataset, measures, limits)


def _measures(dataset: xr.Dataset) -> dict[str, Array]:
    return {criterion.MEASURE: dataset[criterion.MEASURE].values for criterion in CRITERIA.values()}


def _limits(dataset: xr.Dataset) -> verdicts.Limits | None:
    """Return the limits of the criteria that the runs were asked, if the file says them."""
    return verdicts.limits_in(str(dataset.attrs["criteria"])) if "criteria" in dataset.attrs else None


def _early(dataset: xr.Dataset, measures: dict[str, Array], limits: verdicts.Limits | None) -> list[str]:
    """A run ends early only where that is asked, once every criterion is decided: at the latest when it fails."""
    steps, verdict = dataset["steps"].values[:, None], dataset["verdict"].values
    done, decided = dataset["steps_done"].values, dataset["decided"].values
    if not int(dataset.attrs["early_stop"]) or limits is None:
        return verdicts.early(done, steps, verdict)
    names = meanings_of(dataset["criterion"])
    asked = [names.index(name) for name in limits.least]
    found = verdicts.early(done, steps, verdict, np.all(decided[..., asked] > 0, axis=-1))
    for name, most in limits.most.items():
        fails = measures[CRITERIA[name].MEASURE] > CRITERIA[name].BASE + most
        step = decided[..., names.index(name)]
        found += outside(f"decided of {name}", step, ~fails | (step > 0), "the step at which it failed")
    return found


def _cells(dataset: xr.Dataset) -> list[str]:
    """Every cell is there once, and has the ωh of its scene."""
    scene, _ = scene_of(dataset)
    contact, stiffness, steps = (dataset[name].values for name in ("contact", "stiffness", "steps"))
    found = outside("steps", steps, steps >= 1, "a number >= 1")
    found += outside("stiffness", stiffness, (stiffness >= 0) & (stiffness < np.inf), "a number >= 0 that is finite")
    if found:
        return found
    omega = np.array([theory.contact_frequency(float(value), scene.cube.mass) for value in stiffness])
    right = omega * (scene.duration / steps)
    found += unequal("omega_h", dataset["omega_h"].values, right, 8 * ROUNDING * right, "√(4 S/m) times the step size")
    cells = np.rec.fromarrays([contact, stiffness, steps])
    first = np.zeros(len(cells), bool)
    first[np.unique(cells, return_index=True)[1]] = True
    return found + outside("steps", steps, first, "a cell that is not there already")


def of_cells(dataset: xr.Dataset) -> list[str]:
    """Return a line for everything in a collected sweep that cannot be so."""
    _, found = scene_of(dataset)
    found += _cells(dataset)
    members = int(dataset.attrs["members"])
    failing, counts = dataset["failing"].values, dataset["verdicts"].values
    found += outside("failing", failing, (failing >= 0) & (failing <= members), f"a number from 0 to {members}")
    found += outside("verdicts", counts, counts >= 0, "a number >= 0")
    found += unequal("sum of verdicts", counts.sum(axis=1), members, 0.0, "the members of a cell")
    passed = counts[:, meanings_of(dataset["verdict"]).index("passed")]
    most = members - failing.max(axis=0)
    found += outside("verdicts of passed", passed, passed <= most, "at most the members that fail no criterion")
    computed = dataset["steps_computed"].values
    most_steps = members * dataset["steps"].values
    found += outside(
        "steps_computed", computed, (computed >= 0) & (computed <= most_steps), "from 0 to members * steps"
    )
    found += outside("tolerance", dataset["tolerance"].values, dataset["tolerance"].values >= 0, "a number >= 0")
    for name in (f"largest_{criterion.MEASURE}" for criterion in CRITERIA.values()):
        if name in dataset:
            worst = dataset[name].values
            found += outside(name, worst, (worst >= 0) | np.isnan(worst), "a number >= 0, or none")
    return found


def of_edges(dataset: xr.Dataset) -> list[str]:
    """Return a line for everything in a frontier that cannot be so."""
    scene, found = scene_of(dataset)
    first, last, needed = (dataset[name].values for name in frontier.EDGES)
    for name, edge in zip(frontier.EDGES, (first, last, needed), strict=True):
        found += outside(name, edge, (edge >= 1) | np.isnan(edge), "a number >= 1, or none")
    found += outside("steps_needed", needed, ~(needed <= last), "more than last_fail")
    found += outside("steps_needed", needed, ~(needed < first), "at least first_pass")
    flips = dataset["flips"].values
    found += outside("flips", flips, flips >= 0, "a number >= 0")
    shares = [dataset[f"pass_fraction{end}"].values for end in ("_low", "", "_high")]
    inside = (shares[0] >= 0) & (shares[0] <= shares[1]) & (shares[1] <= shares[2]) & (shares[2] <= 1)
    found += outside("pass_fraction", shares[1], inside, "from 0 to 1, within its interval")
    grounds = dataset["stiffness"].values
    omega = np.array([theory.contact_frequency(float(value), scene.cube.mass) for value in grounds])
    right = omega * scene.duration / theory.STABILITY_LIMIT
    return found + unequal("limit", dataset["limit"].values, right, 8 * ROUNDING * right, "steps at ωh = 2")


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
        again = frontier.find(collected)
    rooms: dict[str, npt.ArrayLike] = dict.fromkeys(frontier.FIT, _FIT_ROUNDING)
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
