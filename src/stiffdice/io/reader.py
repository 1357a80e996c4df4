"""Files in: whole, of a format this code knows, and with nothing in them that points outside."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from itertools import chain
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import numpy.typing as npt

from stiffdice.errors import InputError, RefusedError
from stiffdice.io import isolation
from stiffdice.io.cf_enums import labelled
from stiffdice.io.plain_dataset import PlainDataset, PlainVariable
from stiffdice.io.structure_check import Contents, check_values, opened, told

if TYPE_CHECKING:
    import xarray as xr

# Of a file of runs about so many are in memory at a time; a run takes some 130 bytes.
RUNS_AT_ONCE = 1 << 14


def open_file(path: str | Path) -> xr.Dataset:
    """Return the dataset in a file of ours, loaded; raises InputError as `plain_file` does."""
    import xarray as xr

    return xr.Dataset(*plain_file(path))


def plain_file(path: str | Path) -> PlainDataset:
    """Return the dataset in a file of ours, loaded; raises InputError, naming the file, if it cannot be trusted.

    What is not ours is refused before a value is read (`io.structure_check`), damage by its seal. A file from elsewhere
    is to be tried in another process before (`io.isolation`).
    """
    import psutil

    with told(path), opened(path) as (file, contents):
        size, memory = sum(variable.size for variable in contents.variables.values()), psutil.virtual_memory().total
        if size > memory:
            raise InputError(f"holds {size / 1e9:.3g} GB: this machine has {memory / 1e9:.3g} GB of memory")
        return _dataset(contents, {name: _values(file, contents, name) for name in contents.variables})


def open_results(path: str | PathLike[str]) -> xr.Dataset:
    """Return the dataset in a file of stiffdice, loaded, with enums as words: `sel(contact="gated")`, `sel(axis="z")`.

    path: of a file of any kind (docs/reference/FORMAT.md says dimensions and units). `xarray.open_dataset` opens the
    same file with the enums as the numbers that are stored.

    Raises InputError, naming the file, if it cannot be read or trusted (docs/reference/trust.md).
    """
    name = str(path)
    isolation.admit(name)
    return labelled(open_file(name))


def parts(path: str | Path, cells: int | None = None) -> Iterator[xr.Dataset]:
    """Yield a file of runs part by part, so many cells at a time, loaded; raises InputError as `open_file` does.

    By default so many cells that a part holds about RUNS_AT_ONCE runs: what is in memory does not grow with the file,
    and what a part costs by itself is little beside its runs.
    """
    import xarray as xr

    with ExitStack() as stack:
        with told(path):
            file, contents = stack.enter_context(opened(path))
            growing = {name for name, variable in contents.variables.items() if "cell" in variable.dimensions}
            if not growing:
                raise RefusedError(f"{path}: has no dimension cell; not a file of runs")
            others = {name: _values(file, contents, name) for name in contents.variables.keys() - growing}
        shapes = ((variable.dimensions, file[name].shape) for name, variable in contents.variables.items())
        sizes = dict(chain.from_iterable(zip(*pair, strict=True) for pair in shapes))
        chunks = (
            file[name].chunks[variable.dimensions.index("cell")]
            for name, variable in contents.variables.items()
            if {"cell", "member"} <= set(variable.dimensions) and file[name].chunks
        )
        together = max(chunks, default=1)  # whole chunks, so that none is unpacked twice
        count = cells or together * max(1, RUNS_AT_ONCE // (together * max(1, sizes.get("member", 1))))
        for first in range(0, sizes["cell"], count):
            with told(path):
                found = others | {k: _values(file, contents, k, first, first + count) for k in growing}
                part = xr.Dataset(*_dataset(contents, found))
            yield part


def head(path: str | Path, names: Sequence[str]) -> tuple[Mapping[str, Any], dict[str, npt.NDArray[Any]]]:
    """Return the attributes of a file of ours, and some of its variables; raises InputError as `open_file` does."""
    with told(path), opened(path) as (file, contents):
        return contents.attributes, {name: _values(file, contents, name) for name in names}


def some(path: str | Path, cells: Sequence[int], members: slice) -> dict[str, npt.NDArray[Any]]:
    """Return some members in some cells of a file of runs, loaded, by name, what has cells as its first dimension.

    Cells are ascending; those between them are read, too. Raises InputError as `open_file` does.
    """
    first = cells[0]
    rows = [cell - first for cell in cells]
    with told(path), opened(path) as (file, contents):
        return {
            name: _values(file, contents, name, first, cells[-1] + 1)[rows, members]
            for name, variable in contents.variables.items()
            if variable.dimensions[:2] == ("cell", "member")
        }


def _values(file: h5py.File, contents: Contents, name: str, first: int = 0, end: int | None = None) -> np.ndarray:
    """Return a variable's values, of some cells if it has cells; raises RefusedError at what no file of ours holds."""
    variable = contents.variables[name]
    place = tuple(slice(first, end) if dimension == "cell" else slice(None) for dimension in variable.dimensions)
    found = np.asarray(file[name][place])
    found = found.astype(found.dtype.newbyteorder("="), copy=False)
    check_values(name, variable, found)
    return found


def _dataset(contents: Contents, found: Mapping[str, np.ndarray]) -> PlainDataset:
    """Return checked values as what their file says they are."""
    known = {name: variable for name, variable in contents.variables.items() if name in found}
    made = {name: PlainVariable(part.dimensions, found[name], part.attributes) for name, part in known.items()}
    coordinates = {name: made.pop(name) for name, part in known.items() if part.is_coordinate}
    return PlainDataset(made, coordinates, contents.attributes)
