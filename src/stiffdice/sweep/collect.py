"""Shards collected into one sweep of judged cells: how many members fail, and the worst of each measure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.code_digest import code_digest
from stiffdice.errors import InputError
from stiffdice.io import schema
from stiffdice.io.content_digest import cell_digests, runs_digest
from stiffdice.simulation import dataset
from stiffdice.simulation.criteria import judge
from stiffdice.simulation.criteria import registry as criteria
from stiffdice.simulation.outcome import Verdict
from stiffdice.sweep.shard import MEANINGS, differing


def collect(
    parts: Iterable[xr.Dataset], tolerances: Mapping[str, float], config: Mapping[str, Any] | None = None
) -> xr.Dataset:
    """Return all cells of all shards, judged: how many members fail each criterion, and the worst of each measure.

    parts: shards, or some cells of one at a time (`io.reader.parts`): in memory are one part, and some 250 bytes for
    each cell before it, however many members it has. config: what was asked of the whole; None leaves what was asked of
    each run. Cells are sorted by contact law, stiffness and steps. Raises InputError if the shards were not made from
    the same scene by the same code, or if there are none.
    """
    pattern: xr.Dataset | None = None
    columns: dict[str, list[npt.NDArray[Any]]] = {}  # of each variable that has cells, its parts
    digests = []
    for part in parts:
        judged = _judged(part, tolerances)
        pattern = judged.isel(cell=slice(0)) if pattern is None else pattern
        if other := differing(judged.attrs, pattern.attrs):
            raise InputError(f"shards differ in {', '.join(other)}; they are not of one sweep")
        for name, variable in judged.variables.items():
            if "cell" in variable.dims:
                columns.setdefault(str(name), []).append(variable.values)
        digests.append(cell_digests(part))
    if pattern is None:
        raise InputError("there are no shards; nothing to collect")
    order = np.lexsort([np.concatenate(columns[key]) for key in ("steps", "stiffness", "contact")])
    whole = dict(pattern.variables)
    for name in list(columns):  # emptied meanwhile: none is to be there twice
        dims, attributes = whole[name].dims, whole[name].attrs
        axis = dims.index("cell")
        whole[name] = xr.Variable(dims, np.concatenate(columns.pop(name), axis).take(order, axis), attributes)
    asked = dataset.config_attributes("sweep", config) if config is not None else {"kind": "sweep"}
    return (
        xr.Dataset(whole, attrs=pattern.attrs)
        .set_coords(list(pattern.coords))
        .assign_attrs(
            asked,
            title="Sweep of stiffness and steps",
            runs_digest=runs_digest(digests),
            judging_code_digest=code_digest("stiffdice.sweep.collect"),
        )
    )


def _judged(runs: xr.Dataset, tolerances: Mapping[str, float]) -> xr.Dataset:
    """Return cells with what their members add up to."""
    measures = {part.MEASURE: runs[part.MEASURE].values for part in criteria.CRITERIA.values()}
    verdicts = runs["verdict"].values
    counts = np.stack([(verdicts == verdict).sum(axis=1) for verdict in Verdict], axis=1)
    values: dict[str, Any] = {
        "failing": (~judge.passes(tolerances, measures, runs["ending"].values)).sum(axis=-1).astype(np.int32),
        "verdicts": counts.astype(np.int32),
        "steps_computed": runs["steps_computed"].values.sum(axis=1),
        "tolerance": list(tolerances.values()),
    }
    for name in (criteria.CRITERIA[criterion].MEASURE for criterion in tolerances):
        long_name = f"of all members: {dataset.MEASURE_ATTRIBUTES[name]['long_name']}"
        numbers = np.where(np.isnan(measures[name]), -np.inf, measures[name]).max(axis=1)
        largest = np.where(np.isneginf(numbers), np.nan, numbers)  # not-a-number only where all members are
        values[f"largest_{name}"] = "cell", largest, {"long_name": long_name, "units": "1"}
    values |= {name: runs[name].values for name in dataset.CELL_ATTRIBUTES}
    values |= {
        "criterion": np.arange(len(tolerances), dtype=np.int8),
        "verdict": np.arange(len(Verdict), dtype=np.int8),
    }
    attributes = dict(runs.attrs) | {"members": runs.sizes["member"]}
    return schema.dataset("sweep", values, MEANINGS | {"criterion": list(tolerances)}, attributes)
