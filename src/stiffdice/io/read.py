"""Files in: whole, of a format this code knows, and with nothing in them that points outside."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

import xarray as xr

from stiffdice.errors import InputError, RefusedError
from stiffdice.io import values
from stiffdice.io.checked import opened, told
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
