"""Files in: whole, of a format this code knows, and with nothing in them that points outside."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import h5py
import xarray as xr

from stiffdice.errors import InputError
from stiffdice.io import FORMAT_VERSION


def open_file(path: str | Path) -> xr.Dataset:
    """Return the dataset in a file of ours, loaded; raises InputError, naming the file, if it cannot be trusted.

    A file from elsewhere is not trusted: links, external storage and virtual datasets are refused, checksums checked.
    """
    try:
        _inspect(Path(path))
        with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as dataset:
            return dataset.load()
    except InputError as error:
        raise error.within(str(path)) from None
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        if isinstance(error, OSError) and error.strerror:
            raise InputError(f"{path}: {error.strerror}") from None
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path}: not a readable HDF5 file ({reason})") from None


def _inspect(path: Path) -> None:
    with path.open("rb"):  # a missing file should say so in the system's words
        pass
    with h5py.File(path, "r") as file:
        version = file.attrs.get("format_version")
        if not isinstance(version, str):
            raise InputError("has no format_version; not a file of stiffdice")
        if version.split(".")[0] != FORMAT_VERSION.split(".")[0]:
            raise InputError(f"format_version = {version}: allowed is {FORMAT_VERSION.split('.')[0]}.x")
        for name, item in _members(file):
            if not isinstance(item, h5py.Dataset):
                raise InputError(f"{name}: a group; our files have none")
            if item.is_virtual or item.external:
                raise InputError(f"{name}: keeps its data outside of this file")


def _members(file: h5py.File) -> Iterator[tuple[str, object]]:
    for name in file:
        if not isinstance(file.get(name, getlink=True), h5py.HardLink):
            raise InputError(f"{name}: a link that points elsewhere")
        yield name, file[name]
