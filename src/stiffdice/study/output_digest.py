"""Whether the files of a result are those that its job made: their digests, which the job's log says as it ends."""

from __future__ import annotations

import hashlib
from pathlib import Path, PurePosixPath

from stiffdice.io import seal
from stiffdice.study.job_log import Told

_DIGITS = 16


def digest_of(path: Path) -> str:
    """Return the first digits of a file's SHA-256; empty if it is none that can be read.

    Of an HDF5 file what its seal says, so that a file of any size takes a short read; empty without a seal.
    """
    try:
        if not path.is_file():
            return ""
        if path.suffix == ".h5":
            return (seal.digest_in(path) or "")[:_DIGITS]
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()[:_DIGITS]
    except OSError:
        return ""


def changed(told: Told, folder: Path, *files: str) -> list[str]:
    """Return those of some files that are there, but not with the digest that the job's log says, if it says one.

    told: the log; files: relative to `folder`, results/STUDY.
    """
    there = (file for file in files if (folder / file).exists())
    return [file for file in there if told.made.get(file, "none") != digest_of(folder / file)]


def reason(told: Told, files: list[str]) -> str:
    """Return in words what is wrong with files that `changed` found; empty if it found none."""
    if not files:
        return ""
    if not all(file in told.made for file in files):
        return "no log says that its job made it"
    kinds = " and ".join(PurePosixPath(file).suffix for file in files)
    return f"its {kinds} is not what its job made: another file in its place, or changed by hand"
