"""Text that somebody else may have written: no more of it is read than is allowed, and nothing is waited for."""

from __future__ import annotations

import csv
import errno
import io
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from stiffdice.errors import InputError

LARGEST_TABLE = 10_000_000  # bytes; a line of shards.csv has under a hundred


def beginning(path: str | Path, most: int) -> bytes:
    """Return up to so many bytes of a file; raises OSError, also at a pipe into which nobody writes."""
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # a pipe is opened without waiting for who writes
    os.set_blocking(handle, True)
    with os.fdopen(handle, "rb") as file:
        found = file.read(most)
        if not found and stat.S_ISFIFO(os.fstat(handle).st_mode):
            raise OSError(errno.ENODATA, os.strerror(errno.ENODATA))
    return found


def text_of(path: str | Path, most: int) -> str:
    """Return a text file of up to so many bytes; raises InputError, naming it, if it is longer or cannot be read."""
    try:
        raw = beginning(path, most + 1)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
    if len(raw) > most:
        raise InputError(f"{path}: larger than {most} bytes")
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file (UTF-8)") from None


def rows_of(path: str | Path) -> Iterator[dict[str, str]]:
    """Yield the lines of a CSV table by the names in its first; raises InputError, naming it, if it is none."""
    text = text_of(path, LARGEST_TABLE)
    try:
        yield from csv.DictReader(io.StringIO(text, newline=""))
    except csv.Error as error:
        raise InputError(f"{path}: not a table ({error})") from None
