"""A file opened as HDF5 once its seal, its version and its structure were found to be ours."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py

from stiffdice.errors import InputError, RefusedError
from stiffdice.io import attributes, seal, structure


@contextmanager
def opened(path: str | Path) -> Iterator[tuple[h5py.File, structure.Contents]]:
    """Give a file of ours and what it holds; raises InputError, not naming the file, if it cannot be trusted."""
    place = Path(path)
    about = place.stat()
    if not stat.S_ISREG(about.st_mode) and not stat.S_ISDIR(about.st_mode):
        raise InputError("is not a regular file")  # a pipe would be waited for
    sealed = seal.is_sealed(place)
    if sealed:
        seal.check(place)
    with h5py.File(place, "r") as file:
        attributes.check_version(file, sealed)
        yield file, structure.check(file, about.st_size)


@contextmanager
def told(path: str | Path) -> Iterator[None]:
    """Say in one line, with the file's name, what goes wrong while reading it."""
    try:
        yield
    except InputError as error:
        raise error.within(str(path)) from None
    except MemoryError:
        raise RefusedError(f"{path}: needs more memory than there is") from None
    except (OSError, LookupError, ValueError, RuntimeError, TypeError, ArithmeticError) as error:
        if isinstance(error, OSError) and error.strerror:
            raise InputError(f"{path}: {error.strerror}") from None
        reason = attributes.shown(str(error).splitlines()[0] if str(error) else type(error).__name__)
        raise RefusedError(f"{path}: not a readable HDF5 file ({reason})") from None
