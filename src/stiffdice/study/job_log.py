"""What a job's log says: begun, how far, what was made, and how it ended; written line by line, and read back.

A log that has no last word is of a job that is still running, or of one that was killed. Logs are side files, so times
and hosts are told here and in no result. The digests in them tell whether a file is the one that its job made.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from stiffdice.errors import InputError, StiffdiceError, printable
from stiffdice.io import host, seal, text_file

# Bytes that are read, of a log and of a benchmark file (two lines of numbers); digits that are kept of a digest.
_MOST, _LARGEST_BENCHMARK, _DIGITS = 1 << 20, 10_000, 16

# Lines: what the job was asked (`outputs.Asked`); a file that it made, and its digest; the fraction of the work
# done; cells and runs in a finished shard; the most memory [MB] held at a time; the seconds of a job that made what it
# should; the signal that told it to stop. `begun` and `failed` are below.
asked = "asked: {}".format
made = "made: {} {}".format
tenth = "{:.0%} done".format
cells = "{} cells, {} runs".format
memory = "memory: {:.0f} MB".format
done = "done in {:.1f} s".format
interrupted = "interrupted: told to stop ({})".format

_BEGUN = re.compile(r"^begun (\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ) by process (\d{1,10}) on (.+)$", re.MULTILINE)
_TENTH = re.compile(r"^(\d{1,3})% done$", re.MULTILINE)
_ASKED = re.compile(r"^asked: ([a-z0-9 -]{1,200})$", re.MULTILINE)
_MADE = re.compile(r"^made: ([A-Za-z0-9_./-]{1,300}) ([0-9a-f]{16})$", re.MULTILINE)
_CELLS = re.compile(r"^(\d{1,18}) cells, \d+ runs$", re.MULTILINE)
_END = re.compile(r"^(?:(done) in ([0-9.]{1,18}) s|(failed|interrupted): (.*))$", re.MULTILINE)


class Told(NamedTuple):
    """What a log says so far.

    begun: when (UTC), None if it does not say. process, host: of the job. asked: digests of what it was asked
    (`outputs.Asked`), empty if it does not say. progress: fraction of the work done. made: digests of the files that
    the job made (`digest_of`), by their paths under results/STUDY. cells: in the finished shard, if it says. ending:
    `done`, `failed` or `interrupted`; empty without a last word. reason: of an ending that is not `done`, one line.
    written: when the log was last written to (UTC).
    """

    begun: datetime | None
    process: int
    host: str
    asked: str
    progress: float
    made: Mapping[str, str]
    cells: int | None
    ending: str
    reason: str
    written: datetime
    empty: bool


def begun() -> str:
    """Return the first line of a log: when, and which process on which host."""
    return f"begun {datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} by process {os.getpid()} on {host.name()}"


def failed(error: BaseException) -> str:
    """Return the line that ends a job by an error."""
    return f"failed: {reason_of(error)}"


def reason_of(error: BaseException) -> str:
    """Return an error as one line: its own words if it is one of ours, otherwise what kind of trouble it is."""
    text = printable(" ".join(str(error).split()))
    if isinstance(error, StiffdiceError):
        return text
    if isinstance(error, MemoryError):
        return f"not enough memory ({text})" if text else "not enough memory"
    if isinstance(error, OSError) and error.strerror:
        return printable(f"{error.filename}: {error.strerror}") if error.filename else error.strerror
    return f"a mistake in the program: {type(error).__name__}{': ' if text else ''}{text}"


def text_of(path: Path) -> str:
    """Return the text of a log as far as it is read; raises OSError."""
    return text_file.beginning(path, _MOST).decode("utf-8", "replace")


def read(path: Path) -> Told | None:
    """Return what a log says, None if there is none that can be read."""
    try:
        text, written = text_of(path), datetime.fromtimestamp(path.stat().st_mtime, UTC)
    except OSError:
        return None
    first, asked, end = (pattern.search(text) for pattern in (_BEGUN, _ASKED, _END))  # a traceback may follow
    shares, counts, begun = _TENTH.findall(text), _CELLS.findall(text), None
    with contextlib.suppress(ValueError):  # month 13
        begun = datetime.fromisoformat(first[1]) if first else None
    return Told(
        begun=begun,
        process=int(first[2]) if first else 0,
        host=printable(first[3]) if first else "",
        asked=asked[1] if asked else "",
        progress=min(int(shares[-1]) / 100, 1.0) if shares else 0.0,
        made=dict(_MADE.findall(text)),
        cells=int(counts[-1]) if counts else None,
        ending=(end[1] or end[3]) if end else "",
        reason=printable(end[4] or "") if end else "",
        written=written,
        empty=not text,
    )


def is_alive(told: Told) -> bool | None:
    """Return whether the process that began a log still runs, and is not another with its number.

    None if it is of another host, where it cannot be looked for.
    """
    if told.begun is None or told.host != host.name():
        return None
    started = started_at(told.process)
    return started is not None and started <= told.begun.timestamp() + 2  # both are rounded


def started_at(process: int) -> float | None:
    """Return when a process of this host started [s since the epoch], None if none has that number or it has ended.

    Where the system does not tell when it started, 0.
    """
    import psutil

    try:
        found = psutil.Process(process)
        return None if found.status() in (psutil.STATUS_ZOMBIE, psutil.STATUS_DEAD) else found.create_time()
    except psutil.NoSuchProcess:
        return None
    except psutil.AccessDenied:
        return 0.0


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


def reason_of_change(told: Told, files: list[str]) -> str:
    """Return in words what is wrong with files that `changed` found; empty if it found none."""
    if not files:
        return ""
    if not all(file in told.made for file in files):
        return "no log says that its job made it"
    kinds = " and ".join(PurePosixPath(file).suffix for file in files)
    return f"its {kinds} is not what its job made: another file in its place, or changed by hand"


def took(benchmark: Path) -> float | None:
    """Return the seconds in one of Snakemake's benchmark files, None if there is none that is whole."""
    try:
        return float(text_file.text_of(benchmark, _LARGEST_BENCHMARK).splitlines()[1].split("\t")[0])
    except (InputError, ValueError, IndexError):
        return None
