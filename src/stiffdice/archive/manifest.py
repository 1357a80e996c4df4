"""What is in an archive, byte for byte: a digest of every file, as `sha256sum --check` reads it, too."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from stiffdice.errors import InputError, RefusedError

# At the top of every archive; the only file that it does not list.
NAME = "manifest-sha256.txt"

_LINE = re.compile(r"([0-9a-f]{64})  ([^\n\r]+)")


def files_in(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield what is in a folder and below it, but folders: its path there (with /), and where it lies.

    Links are not followed, also to folders. Raises InputError if a folder cannot be read.
    """

    def refuse(error: OSError) -> None:
        raise InputError(f"{error.filename}: {error.strerror}")

    for top, folders, names in os.walk(folder, onerror=refuse):
        folders.sort()
        for name in sorted([*names, *(name for name in folders if Path(top, name).is_symlink())]):
            path = Path(top, name)
            yield path.relative_to(folder).as_posix(), path


def is_regular(path: Path) -> bool:
    """Return whether a path is a file, not a link to one, and nothing that reading might wait for."""
    return path.is_file() and not path.is_symlink()


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal digits; raises OSError if it cannot be read."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def text_of(digests: Mapping[str, str]) -> str:
    """Return the manifest of files: path (relative, with /) → SHA-256 in hexadecimal digits."""
    return "".join(f"{digests[path]}  {path}\n" for path in sorted(digests))


def parse(text: str) -> dict[str, str]:
    """Return the digest of every file, by path; raises RefusedError naming the line that is none."""
    digests: dict[str, str] = {}
    *lines, rest = text.split("\n")
    for number, line in enumerate(lines, 1):
        found = _LINE.fullmatch(line)
        if found is None:
            raise RefusedError(f"line {number}: allowed are a SHA-256, two spaces and a path")
        if found[2] in digests:
            raise RefusedError(f"line {number}: {found[2]} is listed twice")
        digests[found[2]] = found[1]
    if rest:
        raise RefusedError("does not end with a whole line; it is cut short")
    return digests
