"""Files in: whole, of a format this code knows, and with nothing in them that points outside."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy.typing as npt
import xarray as xr

from stiffdice.errors import InputError, RefusedError
from stiffdice.io import values
from stiffdice.io.checked import opened, told
from stiffdice.io.digest import Plain, plain
from stiffdice.io.structure import Contents


def open_file(path: str | Path) -> xr.Dataset:
    """Return the dataset in a file of ours, loaded; raises InputError, naming the file, if it cannot be trusted.

    What is not ours is refused before a value is read (`io.structure`), damage by its seal. A file from elsewhere is
    to be tried in another process before (`io.quarantine`).
    """
    with told(path):
        contents = _contents(path)
        size, memory = sum(contents.sizes.values()), _memory()
        if size > memory:
            raise InputError(f"holds {size / 1e9:.3g} GB: this machine has {memory / 1e9:.3g} GB of memory")
        with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as dataset:
            return _checked(dataset.load(), contents)


def parts(path: str | Path, cells: int) -> Iterator[xr.Dataset]:
    """Yield a file of runs part by part, so many cells at a time, loaded; raises InputError as `open_file` does."""
    with told(path):
        contents = _contents(path)
        dataset = xr.open_dataset(path, engine="h5netcdf", decode_times=False)
    with dataset:
        if "cell" not in dataset.sizes:
            raise RefusedError(f"{path}: has no dimension cell; not a file of runs")
        for first in range(0, dataset.sizes["cell"], cells):
            with told(path):
                part = _checked(dataset.isel(cell=slice(first, first + cells)).load(), contents)
            yield part


def head(path: str | Path, names: Sequence[str]) -> tuple[dict[str, Plain], dict[str, npt.NDArray[Any]]]:
    """Return the attributes of a file of ours, and some of its variables; raises InputError as `open_file` does."""
    with told(path), opened(path) as (file, contents):
        found = {name: file[name][...] for name in names}
        for name, array in found.items():
            values.check(contents, name, array)
        return {name: plain(value) for name, value in file.attrs.items() if not name.startswith("_")}, found


def some(path: str | Path, cells: Sequence[int], members: slice) -> xr.Dataset:
    """Return some members in some cells of a file of runs, loaded; raises InputError as `open_file` does."""
    with told(path):
        contents = _contents(path)
        with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as dataset:
            return _checked(dataset.isel(cell=list(cells), member=members).load(), contents)


def _memory() -> float:
    """Return how many bytes of memory this machine has; no bound where it does not say."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return math.inf


def _contents(path: str | Path) -> Contents:
    with opened(path) as (_, contents):
        return contents


def _checked(dataset: xr.Dataset, contents: Contents) -> xr.Dataset:
    """Return a loaded dataset; raises RefusedError at what no file of ours holds."""
    for name, variable in dataset.variables.items():
        values.check(contents, str(name), variable.values)
    return dataset
