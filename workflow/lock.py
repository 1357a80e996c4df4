"""One run of a study at a time, in one clone: files that the kernel locks, and frees however their holder ends."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from stiffdice.io import host
from stiffdice.study import job_log

FOLDER = Path(".snakemake", "studies")
_held: list[int] = []  # closed, and so free, when this process ends


class RunningError(Exception):
    """Who makes a study already, and since when, in one line."""


def hold(root: Path, study: str) -> None:
    """Lock a study of the project in `root` for as long as this process lives.

    What the parent of this process has locked is ours, too. Raises RunningError if another process has it. Where files
    cannot be written there is no lock (`room.py` tells of that), nor where the file system has none.
    """
    path = root / FOLDER / study
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError:
        return
    _held.append(file)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.ftruncate(file, 0)
        os.write(file, f"{job_log.begun()}\n".encode())
    except BlockingIOError:
        os.close(_held.pop())
        holder = job_log.read(path)
        if holder is None or (holder.process, holder.host) != (os.getppid(), host.name()):
            raise RunningError(f"{study} is being made already: {_told(holder)}") from None
    except OSError:
        pass


def files(root: Path) -> list[Path]:
    """Return the files that are locked while studies are made: of `root`, and of the copy for `make sweep-million`."""
    return sorted(path for project in (root, root / "results/scale/project") for path in (project / FOLDER).glob("*"))


def check_idle(root: Path) -> None:
    """Raise RunningError if any study of the project in `root` is being made."""
    for path in files(root):
        with path.open() as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                raise RunningError(f"{path.name} is being made: {_told(job_log.read(path))}") from None
            except OSError:
                pass


def _told(holder: job_log.Told | None) -> str:
    if holder is None or holder.begun is None:
        return "another process has locked it"
    return f"by process {holder.process} on {holder.host} since {holder.begun:%Y-%m-%d %H:%M:%S} UTC"
