"""What a study takes on disk, by kind, and what is there besides results: unfinished, outdated and damaged files."""

from __future__ import annotations

import contextlib
import os
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from stiffdice.study import job_log

# What io.writer calls a file that is not finished: .NAME.HOST.PROCESS.part
_PART = re.compile(r"\..+\.(\d{1,10})\.part")

# The folders of results/STUDY; shards and unfinished files are apart, and what is in none of them is `other`.
_FOLDERS = ("runs", "sweeps", "experiments", "figures", "tables", "benchmarks", "logs")


class Use(NamedTuple):
    """Sizes in bytes: of all files, by kind; and of some by their paths, relative to the folder of the study.

    stale: shards of other grids. leftover: unfinished files of processes that do not run here: jobs that were killed,
    or that run on another host. damaged: files set aside.
    """

    kinds: Mapping[str, int]
    stale: Mapping[str, int]
    leftover: Mapping[str, int]
    damaged: Mapping[str, int]

    @property
    def total(self) -> int:
        """All of it."""
        return sum(self.kinds.values())


def of(folder: Path, shards: Collection[str]) -> Use:
    """Return what the files of a study take; shards: those planned, relative to its folder."""
    kinds, stale, leftover, damaged = Counter[str](), {}, {}, {}
    for path, size in sorted(_files(folder)):
        kind = _kind(path)
        kinds[kind] += size
        if path.endswith(".damaged"):
            damaged[path] = size
        elif kind == "shards" and path not in shards:
            stale[path] = size
        elif (part := _part(path)) and job_log.started_at(int(part[1])) is None:
            leftover[path] = size
    return Use(kinds, stale, leftover, damaged)


def _part(path: str) -> re.Match[str] | None:
    return _PART.fullmatch(PurePosixPath(path).name)


def _kind(path: str) -> str:
    if _part(path):
        return "unfinished"
    match path.split("/"):
        case ["sweeps", _, "shards", _]:
            return "shards"
        case [top, _, *_] if top in _FOLDERS:
            return top
    return "other"


def _files(folder: Path) -> Iterator[tuple[str, int]]:
    """Yield every file in a folder with its size, links not followed; what vanishes meanwhile is left out."""
    for top, _, names in os.walk(folder):
        for path in (Path(top, name) for name in names):
            with contextlib.suppress(OSError):
                yield path.relative_to(folder).as_posix(), path.lstat().st_size
