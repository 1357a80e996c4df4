"""The runs of two sweeps, cell by cell, however the cells are dealt to files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.archive.compare import folders
from stiffdice.archive.compare.datasets import Difference, datasets_difference
from stiffdice.archive.compare.values import located
from stiffdice.errors import InputError
from stiffdice.io.content_digest import CELL
from stiffdice.io.reader import open_file


def holds_runs(dataset: xr.Dataset) -> bool:
    """Return whether a dataset is a shard: runs in cells."""
    return {"cell", "member"} <= set(dataset.sizes) and all(
        name in dataset.variables and dataset[name].dims == ("cell",) for name in CELL
    )


def shards_difference(name: str, a: Sequence[Path], b: Sequence[Path], refused: Mapping[str, InputError]) -> Difference:
    """Return how the runs in two sets of shards differ, at once in memory; a file that cannot be trusted is told.

    refused: what another process found wrong with files, by their paths (`isolation.refused`).
    """
    unreadable: list[str] = []
    left, right = (_read(paths, unreadable, refused) for paths in (a, b))
    try:
        found = runs_difference(name, left, right)
    except ValueError as error:  # of xarray, where the shards of one side do not hold the same variables
        found = Difference(name, unreadable=(f"shards that are not alike: {str(error).splitlines()[0]}",))
    return replace(found, unreadable=(*unreadable, *found.unreadable))


def _read(paths: Sequence[Path], unreadable: list[str], refused: Mapping[str, InputError]) -> list[xr.Dataset]:
    found = []
    for path in paths:
        try:
            if not folders.is_regular(path):
                raise InputError(f"{path}: a link, or no file")
            if str(path) in refused:
                raise refused[str(path)]
            dataset = open_file(path)
            if not holds_runs(dataset):
                raise InputError(f"{path}: holds no runs in cells")
            found.append(dataset)
        except InputError as error:
            unreadable.append(str(error))
    return found


def runs_difference(name: str, a: Sequence[xr.Dataset], b: Sequence[xr.Dataset]) -> Difference:
    """Return how runs differ, matched by contact law, stiffness and steps of their cells."""
    if not (a and b):
        only = [tuple(_labels(_joined(part))) if part else () for part in (a, b)]
        return Difference(name, only_a=only[0], only_b=only[1])
    left, right = _joined(a), _joined(b)
    _, at_left, at_right = np.intersect1d(_keys(left), _keys(right), assume_unique=True, return_indices=True)
    found = datasets_difference(name, left.isel(cell=at_left), right.isel(cell=at_right))
    values = tuple(
        replace(part, places=tuple(replace(place, index=()) for place in part.places)) for part in found.values
    )
    alone = [
        tuple(_labels(part.drop_isel(cell=at) if len(at) else part))
        for part, at in ((left, at_left), (right, at_right))
    ]
    return replace(found, values=values, only_a=alone[0], only_b=alone[1])


def _joined(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return all cells as one dataset, each once, in the order of their keys."""
    whole = xr.concat(
        parts, "cell", data_vars="minimal", coords="minimal", compat="override", combine_attrs="drop_conflicts"
    )
    return whole.isel(cell=np.unique(_keys(whole), return_index=True)[1])


def _keys(dataset: xr.Dataset) -> npt.NDArray[np.void]:
    return np.asarray(np.rec.fromarrays([dataset[name].values for name in CELL]))


def _labels(dataset: xr.Dataset) -> list[str]:
    return [located(dataset, ("cell",), (k,)) for k in range(dataset.sizes["cell"])]
