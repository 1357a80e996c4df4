"""What Snakemake and its jobs need of the machine besides cores: folders with room in them, and files to open."""

from __future__ import annotations

import json
import os
import re
import resource
import tempfile
from collections.abc import Iterable
from itertools import chain
from pathlib import Path

ENOUGH = 1 << 16  # bytes that a folder must have room for: what Snakemake notes of some jobs
FILES = 1024  # open at a time, where the machine lets us
FEWEST_FILES, FILES_A_CORE = 24, 4  # below, Snakemake fails in ways of its own


class RoomError(Exception):
    """What is missing, in one line."""


def check_place(root: Path) -> None:
    """Raise RoomError if the path of the project has what shells, Snakemake or Python take for their own."""
    if found := re.search(r"""[\s'"`$;:&|<>(){}*?\[\]!#\\]""", str(root)):
        raise RoomError(f"{str(root)!r}: {found[0]!r} in a path is not for Snakemake; move the project")


def missing(folder: Path) -> str | None:
    """Return why files cannot be written in a folder, which is made if it is not there; None if they can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(prefix=".room.", dir=folder) as file:
            file.write(bytes(ENOUGH))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        return f"{folder}: {error.strerror}"
    return None


def lack_of(root: Path) -> str | None:
    """Return what keeps the workflow in `root` from storing results, and what to do; None if nothing does."""
    for name in ("results", ".snakemake"):
        if reason := missing(root / name):
            return f"{reason}; the same command goes on once files can be written there"
    return None


def forget_rubbish(root: Path) -> None:
    """Remove notes of Snakemake that are not JSON, at which it would stop: what is due does not hang on them.

    Raises RoomError if one cannot be read or removed.
    """
    folders = (root / ".snakemake" / name for name in ("metadata", "incomplete"))
    for path in chain.from_iterable(folder.rglob("*") for folder in folders):
        try:
            if path.is_file() and not _is_note(path):
                path.unlink()
        except OSError as error:
            raise RoomError(f"{path}: {error.strerror}; remove it, then the same command") from None


def _is_note(path: Path) -> bool:
    try:
        return isinstance(json.loads(path.read_bytes()), dict)
    except (ValueError, RecursionError):
        return False


def clear_way(paths: Iterable[Path]) -> None:
    """Remove those logs and benchmarks that lead nowhere or are another user's, so that jobs can write their own.

    Raises RoomError if one cannot be removed.
    """
    for path in paths:
        leads_nowhere = path.is_symlink() and not path.exists()
        if leads_nowhere or (path.is_file() and not os.access(path, os.R_OK | os.W_OK)):
            try:
                path.unlink()
            except OSError as error:
                raise RoomError(f"{path}: {error.strerror}; have it removed, then the same command") from None


def prepare(root: Path, cores: int) -> tuple[dict[str, str], list[str]]:
    """Return changes of the environment with which the workflow can run, and a line on each; raises RoomError if none.

    Temporary files and caches that cannot be where they belong are kept in `root`/.snakemake.
    """
    check_place(root)
    _open_files(cores)
    if reason := lack_of(root):
        raise RoomError(reason)
    changes, told = {}, []
    for variable, wanted, name in (("TMPDIR", _temporary(), "tmp"), ("XDG_CACHE_HOME", [_cache()], "cache")):
        reasons = [(folder, missing(folder)) for folder in wanted]
        if all(reason for _, reason in reasons):
            changes[variable] = str(root / ".snakemake" / name)
            Path(changes[variable]).mkdir(exist_ok=True)
            told.append(f"{reasons[0][1]}; {changes[variable]} is used instead")
        elif reasons[0][1]:
            changes[variable] = next(str(folder) for folder, reason in reasons if not reason)
    return changes, told


def _open_files(cores: int) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    allowed = hard if hard != resource.RLIM_INFINITY else FILES
    if soft != resource.RLIM_INFINITY and soft < min(FILES, allowed):
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(FILES, allowed), hard))
    needed = FEWEST_FILES + FILES_A_CORE * cores
    if allowed < needed:
        raise RoomError(f"{allowed} files may be open at a time (ulimit -n); {cores} cores need {needed}")


def _temporary() -> Iterable[Path]:
    """Return where temporary files are kept, in the order in which Python looks."""
    named = [os.environ[name] for name in ("TMPDIR", "TEMP", "TMP") if os.environ.get(name)]
    return [Path(folder) for folder in (*named, "/tmp", "/var/tmp") if Path(folder).is_dir()]


def _cache() -> Path:
    """Return where Snakemake keeps copies of its rules, and we compiled kernels."""
    return Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))  # noqa: PTH111 (which may raise)
