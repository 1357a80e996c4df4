"""What a study takes on disk, by kind, and what is there besides results: unfinished, outdated and damaged files."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from stiffdice.study import job_log

# What io.write and io.spool call a file that is not finished: .NAME.HOST.PROCESS.part
_PART = re.compile(r"\..+\.(\d{1,10})\.part")

# The folders of results/STUDY; shards are apart, and what is in none of them is `other`.
KINDS = ("runs", "shards", "sweeps", "experiments", "figures", "tables", "benchmarks", "logs", "other")


class Unfinished(NamedTuple):
    """An unfinished file; process: that began it, alive: whether one with its number runs on this host.

    One that is alive is most likely being written; one that is not was left by a job that was killed, or is written on
    another host.
    """

    path: str
    size: int
    process: int
    alive: bool


@dataclass(frozen=True)
class Use:
    """Sizes in bytes; paths are relative to the folder of the study.

    kinds: of all files but unfinished ones, by kind. planned: shards of the grid as it is now. stale: shards of other
    grids, with their sizes. damaged: files set aside.
    """

    kinds: dict[str, int]
    planned: int
    stale: dict[str, int]
    unfinished: tuple[Unfinished, ...]
    damaged: dict[str, int]

    @property
    def total(self) -> int:
        """All of it."""
        return sum(self.kinds.values()) + sum(part.size for part in self.unfinished)


def of(folder: Path, shards: Collection[str]) -> Use:
    """Return what the files of a study take; shards: those planned, relative to its folder."""
    kinds = dict.fromkeys(KINDS, 0)
    planned, stale, damaged, unfinished = 0, {}, {}, []
    for path, size in sorted(_files(folder)):
        part = _PART.fullmatch(PurePosixPath(path).name)
        if part:
            process = int(part[1])
            unfinished.append(Unfinished(path, size, process, job_log.started_at(process) is not None))
            continue
        kind = _kind(path)
        kinds[kind] += size
        if path.endswith(".damaged"):
            damaged[path] = size
        elif kind == "shards" and path in shards:
            planned += size
        elif kind == "shards":
            stale[path] = size
    return Use({kind: size for kind, size in kinds.items() if size}, planned, stale, tuple(unfinished), damaged)


def _kind(path: str) -> str:
    match path.split("/"):
        case ["sweeps", _, "shards", _]:
            return "shards"
        case [top, _, *_] if top in KINDS:
            return top
    return "other"


def _files(folder: Path) -> Iterator[tuple[str, int]]:
    """Yield every file in a folder with its size, links not followed; what vanishes meanwhile is left out."""
    for top, _, names in os.walk(folder):
        for path in (Path(top, name) for name in names):
            with contextlib.suppress(OSError):
                yield path.relative_to(folder).as_posix(), path.lstat().st_size
