"""Many runs: compute the cells of a shard, collect shards into one sweep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from stiffdice import theory
from stiffdice.contact import LAWS
from stiffdice.ensemble import phased
from stiffdice.errors import InputError
from stiffdice.io import layout
from stiffdice.measures import MEASURES
from stiffdice.simulate import Run, simulate
from stiffdice.study import Cell, Sweep


def compute(sweep: Sweep, cells: Sequence[Cell], progress: Callable[[float], None] | None = None) -> xr.Dataset:
    """Return one shard: each cell's measures and verdicts, dimensions cell and member.

    progress: called after every cell with the fraction of the shard's time steps done.
    """
    cost = np.cumsum([cell.steps for cell in cells])
    runs = []
    for cell, done in zip(cells, cost, strict=True):
        runs.append(_run(sweep, cell))
        if progress is not None:
            progress(float(done / cost[-1]))
    return _dataset(sweep, cells, runs)


def _run(sweep: Sweep, cell: Cell) -> Run:
    scene = sweep.scene_of(cell)
    members = phased(scene, sweep.model, cell.steps, sweep.members)
    return simulate(scene, model=sweep.model, scheme=sweep.scheme, steps=cell.steps, members=members)


def _dataset(sweep: Sweep, cells: Sequence[Cell], runs: Sequence[Run]) -> xr.Dataset:
    table = ("cell", "member")
    measures = {name: np.stack([run.measures[name] for run in runs]) for name in MEASURES}
    variables: dict[str, Any] = layout.measure_variables(measures, table)
    variables["verdict"] = (table, np.stack([run.verdict for run in runs]), layout.VERDICT_ATTRIBUTES)
    variables["steps_done"] = (
        table,
        np.stack([run.steps_done for run in runs]),
        {"long_name": "steps within double range", "units": "1"},
    )
    names = list(LAWS)
    omega_h = [theory.omega_h(sweep.scene_of(cell), cell.steps) for cell in cells]
    coordinates = {
        "contact": (
            "cell",
            np.array([names.index(cell.contact) for cell in cells], np.int8),
            layout.CONTACT_ATTRIBUTES,
        ),
        "stiffness": (
            "cell",
            [cell.stiffness for cell in cells],
            {"long_name": "ground stiffness", "units": "kg s-2"},
        ),
        "steps": (
            "cell",
            [cell.steps for cell in cells],
            {"long_name": "number of time steps", "units": "1"},
        ),
        "omega_h": (
            "cell",
            omega_h,
            {"long_name": "contact frequency of a flat landing times step size", "units": "1"},
        ),
        "member": (
            "member",
            np.arange(sweep.members, dtype=np.int32),
            {"long_name": "member: number k of n is launched k/n of a time step late", "units": "1"},
        ),
    }
    attributes = layout.provenance_attributes(
        "Sweep of stiffness and steps", sweep.scene, sweep.model, sweep.scheme, "stiffdice.sweep"
    )
    attributes["scene_note"] = "contact law and stiffness are the cell's, not the scene's"
    return xr.Dataset(variables, coordinates, attributes)


def collect(shards: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return all shards as one dataset, cells sorted by contact law, stiffness and steps.

    Raises InputError if the shards were not made from the same scene by the same code.
    """
    for key in shards[0].attrs:
        if any(str(shard.attrs.get(key)) != str(shards[0].attrs[key]) for shard in shards):
            raise InputError(f"shards differ in {key}; they are not of one sweep")
    whole = xr.concat(shards, dim="cell", data_vars="all", coords="different", compat="equals", join="exact")
    order = np.lexsort([whole[key].values for key in ("steps", "stiffness", "contact")])
    return whole.isel(cell=order)
