"""A file opened as HDF5 once its seal, its version and its structure were found to be ours."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from stiffdice.errors import InputError, RefusedError
from stiffdice.io import seal, structure_check
from stiffdice.io.structure_check import Contents, Variable


@contextmanager
def opened(path: str | Path) -> Iterator[tuple[h5py.File, Contents]]:
    """Give a file of ours and what it holds; raises InputError, not naming the file, if it cannot be trusted."""
    place = Path(path)
    about = place.stat()
    if not stat.S_ISREG(about.st_mode) and not stat.S_ISDIR(about.st_mode):
        raise InputError("is not a regular file")  # a pipe would be waited for
    sealed = seal.check(place)
    with h5py.File(place, "r") as file:
        structure_check.check_version(file, sealed)
        yield file, structure_check.check(file, about.st_size)


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
        reason = structure_check.shown(str(error).splitlines()[0] if str(error) else type(error).__name__)
        raise RefusedError(f"{path}: not a readable HDF5 file ({reason})") from None


def check_values(name: str, variable: Variable, values: np.ndarray[Any, Any]) -> None:
    """Raise RefusedError at a coordinate that is not finite, and at an enum's value that has no word.

    Results may well be NaN or infinite: runs blow up.
    """
    if variable.is_coordinate and values.dtype.kind == "f" and not np.isfinite(values).all():
        raise RefusedError(f"{name}: a coordinate that is not finite")
    if variable.words and (wrong := values[(values < 0) | (values >= variable.words)]).size:
        raise RefusedError(
            f"{name} = {wrong.flat[0]}: allowed is 0 to {variable.words - 1}, which have a word in flag_meanings"
        )
