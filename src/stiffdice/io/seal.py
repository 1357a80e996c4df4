"""A line at the end of a file that says what is before it: damage is seen before anything else is read.

HDF5 itself keeps checksums of compressed values only; a flipped bit in an attribute would be another number. Its
readers pay no attention to what follows the end that the file's own head names, so a sealed file opens everywhere.
"""

from __future__ import annotations

import hashlib
import os
import re
from pathlib import Path

from stiffdice.errors import RefusedError

_LINE = "\nstiffdice seal: sha256 {} of {:020d} bytes\n"
_PATTERN = re.compile(rb"\nstiffdice seal: sha256 ([0-9a-f]{64}) of ([0-9]{20}) bytes\n")
LENGTH = len(_LINE.format("0" * 64, 0))  # bytes

_AT_ONCE = 1 << 20  # bytes read at a time


def line_of(data: bytes | memoryview) -> bytes:
    """Return the line that seals so much data."""
    return _LINE.format(hashlib.sha256(data).hexdigest(), len(data)).encode("ascii")


def seal(path: Path) -> None:
    """Add the line to a finished file; raises OSError if it cannot be written."""
    with path.open("r+b") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        file.write(_LINE.format(digest, file.tell()).encode("ascii"))


def digest_in(path: Path) -> str | None:
    """Return the SHA-256 that the line at the end of a file says, None without one; raises OSError if unreadable."""
    with path.open("rb") as file:
        file.seek(max(os.fstat(file.fileno()).st_size - LENGTH, 0))
        told = _PATTERN.fullmatch(file.read(LENGTH))
        return told[1].decode("ascii") if told else None


def is_sealed(path: Path) -> bool:
    """Return whether a file ends with such a line; raises OSError if it cannot be read."""
    return digest_in(path) is not None


def check(path: Path) -> bool:
    """Return whether a file is sealed; raises RefusedError if it is not as it was sealed, OSError if unreadable."""
    with path.open("rb") as file:
        length = os.fstat(file.fileno()).st_size - LENGTH
        file.seek(max(length, 0))
        told = _PATTERN.fullmatch(file.read(LENGTH))
        if told is None:
            return False
        if int(told[2]) != length:
            raise RefusedError(f"damaged: {length} bytes long, its seal is for {int(told[2])}")
        file.seek(0)
        digest = hashlib.sha256()
        for left in range(length, 0, -_AT_ONCE):
            digest.update(file.read(min(_AT_ONCE, left)))
        if digest.hexdigest().encode("ascii") != told[1]:
            raise RefusedError("damaged: its content is not what was sealed")
        return True
