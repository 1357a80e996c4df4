"""Files that are whole or not there: made in memory, written under a temporary name, fsynced, renamed."""

from __future__ import annotations

import contextlib
import io
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5netcdf

from stiffdice.errors import OutputError
from stiffdice.io import host, seal
from stiffdice.io.plain_dataset import PlainDataset

if TYPE_CHECKING:
    import xarray as xr

_PACKED: dict[str, Any] = {"compression": "gzip", "compression_opts": 4, "shuffle": True, "fletcher32": True}


def check_target(path: str | Path) -> Path:
    """Return `path` if a file can be written there; raises OutputError before any work is done otherwise."""
    target = Path(path)
    if target.exists() and not target.is_file():
        raise OutputError(f"{target}: is {'a folder; name a file in it' if target.is_dir() else 'not a regular file'}")
    if not target.parent.is_dir():
        raise OutputError(f"{target}: the folder {target.parent} does not exist")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise OutputError(f"{target}: the folder {target.parent} is not writable")
    return target


def temporary_of(target: Path) -> Path:
    """Return the name under which this process writes a file before it is whole: `.NAME.HOST.PID.part`, beside it.

    Removes what processes of this host that are gone left of the same file; those of other hosts, and of other
    containers of this one, cannot be asked.
    """
    import psutil

    here = host.name()
    for path, where, process in _unfinished(target):
        if where == here and not psutil.pid_exists(process):
            _remove(path)
    return target.with_name(f".{target.name}.{here}.{os.getpid()}.part")


def clear(target: Path) -> None:
    """Remove all that is unfinished of a file, of whatever host: for one who knows that nobody else writes it."""
    for path, _, _ in _unfinished(target):
        _remove(path)


def _unfinished(target: Path) -> Iterator[tuple[Path, str, int]]:
    """Yield what is unfinished of a file, with the host and the process of its writer."""
    name = re.compile(rf"\.{re.escape(target.name)}\.(.+)\.([0-9]+)\.part")
    with contextlib.suppress(OSError):  # a folder that cannot be read: whoever writes in it says so
        for path in target.parent.iterdir():
            if found := name.fullmatch(path.name):
                yield path, found[1], int(found[2])


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()


@contextlib.contextmanager
def whole(target: Path) -> Iterator[Path]:
    """Give the path under which the block writes a file, which has its name once the block ends.

    Raises OutputError, and leaves what was there before, if it cannot be stored.
    """
    temporary = temporary_of(target)
    try:
        yield temporary
        store(temporary, target)
    except OSError as error:
        raise OutputError(f"{target}: {error.strerror}; nothing was stored") from None
    finally:
        _remove(temporary)


def write_bytes(data: bytes | memoryview, path: str | Path, end: bytes = b"") -> None:
    """Store `data`, and `end` after it, under `path`; raises OutputError, and leaves what was there, if it cannot."""
    with whole(Path(path)) as temporary, temporary.open("wb") as file:
        file.write(data)
        file.write(end)


def store(temporary: Path, target: Path) -> None:
    """Give a finished file its name, once it is safely on disk; raises OSError if it cannot."""
    with temporary.open("rb") as file:
        os.fsync(file.fileno())
    temporary.replace(target)
    with contextlib.suppress(OSError):  # the file is there; some file systems cannot sync a folder
        folder = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(folder)  # so that the name lasts through a power failure
        finally:
            os.close(folder)


def write_dataset(dataset: PlainDataset | xr.Dataset, path: str | Path) -> None:
    """Store a dataset as netCDF-4 on HDF5.

    dataset: as `run_dataset` returns it. path: of the file, which is replaced as a whole or left as it was. The file is
    compressed (gzip, shuffle), has a checksum on every chunk (fletcher32) and is sealed. Equal datasets give equal
    bytes.

    Raises OutputError if it cannot be stored.
    """
    image = io.BytesIO()
    try:
        with h5netcdf.File(image, "w") as file:
            file.attrs.update(dataset.attrs)
            file.dimensions = {str(name): length for name, length in dataset.sizes.items()}
            for name, variable in dataset.variables.items():
                define(file, dataset, str(name))[...] = variable.values
    except OSError as error:  # in memory, but what makes it may have to be loaded first
        raise OutputError(f"{path}: {error.strerror or error}; nothing was stored") from None
    data = image.getbuffer()
    write_bytes(data, path, seal.line_of(data))


def define(
    file: h5netcdf.File, dataset: PlainDataset | xr.Dataset, name: str, chunks: tuple[int, ...] | None = None
) -> h5netcdf.Variable:
    """Return a variable of a dataset, made in an open file with its attributes, and without values.

    chunks: their lengths along the axes; None lets HDF5 choose, and stores a single value as it is.
    """
    variable = dataset.variables[name]
    packed = _PACKED if chunks is not None or variable.values.size > 1 else {}
    made = file.create_variable(name, variable.dims, variable.values.dtype, chunks=chunks, **packed)
    made.attrs.update(variable.attrs)
    labels = {
        str(label)
        for label, part in dataset.coords.items()
        if label not in part.dims and set(part.dims) <= set(variable.dims)
    }
    if name in dataset.data_vars and labels:
        made.attrs["coordinates"] = " ".join(sorted(labels))  # so that readers take them for such (CF)
    return made
