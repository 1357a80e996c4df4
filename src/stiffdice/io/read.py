"""Files in: whole, of a format this code knows, and with nothing in them that points outside."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import xarray as xr

from stiffdice.errors import InputError, RefusedError
from stiffdice.io import FORMAT_VERSION, seal


def open_file(path: str | Path) -> xr.Dataset:
    """Return the dataset in a file of ours, loaded; raises InputError, naming the file, if it cannot be trusted.

    A file from elsewhere is not trusted: links, external storage and virtual datasets are refused, checksums checked.
    """
    with _told(path):
        _inspect(Path(path))
        with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as dataset:
            return dataset.load()


def parts(path: str | Path, cells: int) -> Iterator[xr.Dataset]:
    """Yield a file of runs part by part, so many cells at a time, loaded; raises InputError as `open_file` does."""
    with _told(path):
        _inspect(Path(path))
        dataset = xr.open_dataset(path, engine="h5netcdf", decode_times=False)
    with dataset:
        for first in range(0, dataset.sizes["cell"], cells):
            with _told(path):
                part = dataset.isel(cell=slice(first, first + cells)).load()
            yield part


@contextmanager
def _told(path: str | Path) -> Iterator[None]:
    """Say in one line, with the file's name, what goes wrong while reading it."""
    try:
        yield
    except InputError as error:
        raise error.within(str(path)) from None
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        if isinstance(error, OSError) and error.strerror:
            raise InputError(f"{path}: {error.strerror}") from None
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise RefusedError(f"{path}: not a readable HDF5 file ({reason})") from None


# Versions of the format whose files had no seal.
_UNSEALED = ("1.0", "1.1")


def _inspect(path: Path) -> None:
    sealed = seal.is_sealed(path)
    if sealed:
        seal.check(path)
    with h5py.File(path, "r") as file:
        version = file.attrs.get("format_version")
        if not isinstance(version, str):
            raise RefusedError("has no format_version; not a file of stiffdice")
        if version.split(".")[0] != FORMAT_VERSION.split(".")[0]:
            raise RefusedError(f"format_version = {version}: allowed is {FORMAT_VERSION.split('.')[0]}.x")
        if not sealed and version not in _UNSEALED:
            raise RefusedError("damaged: has no seal at its end; it is cut short, or was changed by another program")
        for name, item in _members(file):
            if not isinstance(item, h5py.Dataset):
                raise RefusedError(f"{name}: a group; our files have none")
            if item.is_virtual or item.external:
                raise RefusedError(f"{name}: keeps its data outside of this file")


def _members(file: h5py.File) -> Iterator[tuple[str, object]]:
    for name in file:
        if not isinstance(file.get(name, getlink=True), h5py.HardLink):
            raise RefusedError(f"{name}: a link that points elsewhere")
        yield name, file[name]
