"""What a job's log says: begun, how far, and how it ended; written line by line, and read back.

A log that has no last word is of a job that is still running, or of one that was killed. Logs are side files, so times
and hosts are told here and in no result.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from stiffdice.errors import StiffdiceError, printable
from stiffdice.io import host
from stiffdice.io.text_file import beginning

# Of a log no more than so many bytes are read.
_MOST = 1 << 20

_BEGUN = re.compile(r"^begun (\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ) by process (\d{1,10}) on (.+)$", re.MULTILINE)
_TENTH = re.compile(r"^(\d{1,3})% of the steps done$", re.MULTILINE)
_ASKED = re.compile(r"^asked: ([a-z0-9 -]{1,200})$", re.MULTILINE)
_MADE = re.compile(r"^made: ([A-Za-z0-9_./-]{1,300}) ([0-9a-f]{16})$", re.MULTILINE)
_CELLS = re.compile(r"^(\d{1,18}) cells, \d+ runs$", re.MULTILINE)
_END = re.compile(r"^(?:(done) in ([0-9.]{1,18}) s|(failed|interrupted): (.*))$", re.MULTILINE)
_TIME = "%Y-%m-%dT%H:%M:%SZ"


class Told(NamedTuple):
    """What a log says so far.

    begun: when (UTC), None if it does not say. process, host: of the job. asked: digests of what it was asked
    (`provenance.Asked`), empty if it does not say. progress: fraction of the work done. made: digests of the files that
    the job made (`output_digest.digest_of`), by their paths under results/STUDY. cells: in the finished shard, if it
    says. ending: `done`, `failed` or `interrupted`; empty without a last word. reason: of an ending that is not `done`,
    one line. written: when the log was last written to (UTC).
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
    return f"begun {datetime.now(UTC).strftime(_TIME)} by process {os.getpid()} on {host.name()}"


def asked(digests: object) -> str:
    """Return the line that tells what the job was asked."""
    return f"asked: {digests}"


def made(file: str, digest: str) -> str:
    """Return the line that tells the digest of a file that the job made."""
    return f"made: {file} {digest}"


def tenth(fraction: float) -> str:
    """Return the line that tells the fraction of the work done."""
    return f"{fraction:.0%} of the steps done"


def cells(count: int, members: int) -> str:
    """Return the line that tells what is in a finished shard."""
    return f"{count} cells, {count * members} runs"


def memory(peak: int) -> str:
    """Return the line that tells the most memory [B] that the job held at a time."""
    return f"memory: {peak / 1e6:.0f} MB"


def done(seconds: float) -> str:
    """Return the last line of a job that made what it should."""
    return f"done in {seconds:.1f} s"


def failed(error: BaseException) -> str:
    """Return the line that ends a job by an error."""
    return f"failed: {reason_of(error)}"


def interrupted(signal: str) -> str:
    """Return the line that ends a job that was told to stop."""
    return f"interrupted: told to stop ({signal})"


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
    return beginning(path, _MOST).decode("utf-8", "replace")


def read(path: Path) -> Told | None:
    """Return what a log says, None if there is none that can be read."""
    try:
        text, written = text_of(path), datetime.fromtimestamp(path.stat().st_mtime, UTC)
    except OSError:
        return None
    first, asked, end = (pattern.search(text) for pattern in (_BEGUN, _ASKED, _END))  # a traceback may follow
    shares, counts = _TENTH.findall(text), _CELLS.findall(text)
    return Told(
        begun=_time(first[1]) if first else None,
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


def _time(text: str) -> datetime | None:
    try:
        return datetime.strptime(text, _TIME).replace(tzinfo=UTC)
    except ValueError:  # month 13
        return None


def is_here(told: Told) -> bool:
    """Return whether a log was written on this host, so that its process can be looked for."""
    return told.host == host.name()


def is_alive(told: Told) -> bool:
    """Return whether the process that began a log on this host still runs, and is not another with its number."""
    if told.begun is None:
        return False
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
