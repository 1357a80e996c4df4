"""A file of many runs, written while they are made: what is in memory does not grow with what is in the file."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5netcdf
import h5py
import numpy as np

from stiffdice.errors import OutputError
from stiffdice.io import seal
from stiffdice.io.writer import check_target, define, store, temporary_of

if TYPE_CHECKING:
    import xarray as xr

# Of one chunk: small enough that a block of members or a handful of cells fills it, large enough to compress. Of fewer
# members it holds more cells, as many runs in all: a file has the fewer chunks.
CHUNK_CELLS, CHUNK_MEMBERS = 16, 64
_CHUNK_RUNS = CHUNK_CELLS * CHUNK_MEMBERS

_BUFFER = 1 << 19  # bytes of each variable that HDF5 may hold back; by itself it would take 16 times as much


class Spool:
    """Writes a dataset of dimensions cell and member part by part; the file is there, whole, when the block ends.

    pattern: a dataset of one cell and all members that says what there is: names, types, attributes, dimensions.
    Equal parts in equal order give equal bytes. Raises OutputError if the file cannot be written; nothing is left then.
    """

    def __init__(self, path: str | Path, pattern: xr.Dataset) -> None:
        self._target = check_target(path)
        self._temporary = temporary_of(self._target)
        self._pattern = pattern
        self.cells = 0

    def __enter__(self) -> Spool:
        try:
            self._file = h5py.File(self._temporary, "w", track_order=True, rdcc_nbytes=_BUFFER)
            with h5netcdf.File(self._file, "w") as netcdf:
                netcdf.dimensions = {"cell": None, "member": self._pattern.sizes["member"]}
                netcdf.attrs.update(self._pattern.attrs)
                for name, variable in self._pattern.variables.items():
                    self._create(netcdf, str(name), variable)
        except BaseException as error:  # a signal, too: __exit__ is not called then
            self._temporary.unlink(missing_ok=True)
            if isinstance(error, OSError):
                raise self._told(error) from None
            raise
        # HDF5's own from here on: looking up the length of a dimension that grows takes h5netcdf longer than a write.
        self._stored = {str(k): (self._file[str(k)], part.dims) for k, part in self._pattern.variables.items()}
        self._growing = [self._file["cell"], *(stored for stored, dims in self._stored.values() if "cell" in dims)]
        return self

    def _create(self, netcdf: h5netcdf.File, name: str, variable: xr.Variable) -> None:
        members = min(CHUNK_MEMBERS, self._pattern.sizes["member"])
        cells = _CHUNK_RUNS // members if "member" in variable.dims else _CHUNK_RUNS
        sizes = {"cell": cells, "member": members}
        for dimension, size in variable.sizes.items():
            if dimension not in netcdf.dimensions:
                netcdf.dimensions[str(dimension)] = size
        chunks = tuple(sizes.get(str(dimension), size) for dimension, size in variable.sizes.items())
        stored = define(netcdf, self._pattern, name, chunks)
        if "cell" not in variable.dims:
            stored[...] = variable.values

    def add_cells(self, count: int) -> int:
        """Make room for so many more cells, and return the number of the first."""
        first, self.cells = self.cells, self.cells + count
        for stored in self._growing:
            stored.resize(self.cells, axis=0)
        return first

    def put(self, values: Mapping[str, np.ndarray[Any, Any]], cells: slice, members: slice = slice(None)) -> None:
        """Store values by name for some cells, and of those that have members for some of them."""
        try:
            for name, value in values.items():
                stored, dimensions = self._stored[name]
                given = {"cell": cells, "member": members}
                stored[tuple(given.get(str(dimension), slice(None)) for dimension in dimensions)] = value
        except OSError as error:
            raise self._told(error) from None

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            self._file.close()
            if kind is None:
                seal.seal(self._temporary)
                store(self._temporary, self._target)
        except (OSError, RuntimeError) as failure:
            if kind is None:  # otherwise what ended the block is told
                raise self._told(failure) from None
        finally:
            self._temporary.unlink(missing_ok=True)

    def _told(self, error: OSError | RuntimeError) -> OutputError:
        """Return in one line what HDF5 says in many."""
        said = re.search(r"errno = ([0-9]+)", str(error))
        number = getattr(error, "errno", None) or (int(said[1]) if said else None)
        reason = os.strerror(number) if number else str(error).splitlines()[0]
        return OutputError(f"{self._target}: {reason}; nothing was stored")
