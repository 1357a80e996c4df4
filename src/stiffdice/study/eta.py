"""About how long what is left of a study takes, going by how long its jobs took so far, else by `forecast`."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, NamedTuple

from stiffdice.errors import InputError
from stiffdice.io.text_file import text_of

if TYPE_CHECKING:
    from stiffdice.study.job_log import Told
    from stiffdice.study.outputs import Result

_LARGEST_BENCHMARK = 10_000  # bytes; two lines of numbers


class Job(NamedTuple):
    """What is known of how long one job takes; all times in seconds.

    kind: jobs of one kind take as long as their weight says. took: the job, when it last ended well, or in all by its
    progress; None if neither is known. due: whether it is still to be made. elapsed: since it began, 0 if it is not
    running. alone: whether nothing runs beside it.
    """

    kind: str
    weight: float
    took: float | None
    due: bool
    elapsed: float = 0.0
    alone: bool = False


class Left(NamedTuple):
    """seconds: about how long what is left takes on `cores` cores."""

    seconds: float
    cores: int


def job(result: Result, weight: float, log: Told | None, *, due: bool, took: float | None) -> Job:
    """Return what is known of a result's job; log: of a running one."""
    kind = f"shard {result.name.partition('/')[0]}" if result.stage == "shard" else result.stage
    found = Job(kind, weight, took, due, alone=result.stage == "timings")
    if log is None or log.begun is None:
        return found
    if log.progress:
        found = found._replace(took=(log.written - log.begun).total_seconds() / log.progress)
    return found._replace(elapsed=(datetime.now(UTC) - log.begun).total_seconds())


def of(jobs: Sequence[Job], cores: int, pace: float) -> Left:
    """Return about how long the jobs that are due take; `cores` of them at a time, those that are `alone` one by one.

    A job takes as long as it took before; one that never ended, as the median of its kind. Of a kind of which none
    ended, as all that have; where none has, `pace` [s] for each of its weight.
    """
    ended = [(job.kind, job.took / job.weight) for job in jobs if job.took is not None]
    pace = median(rate for _, rate in ended) if ended else pace
    rates = {kind: median(rate for other, rate in ended if other == kind) for kind in dict(ended)}
    shared, alone = [0.0], [0.0]
    for job in jobs:
        if job.due:
            whole = rates.get(job.kind, pace) * job.weight if job.took is None else job.took
            (alone if job.alone else shared).append(max(0.0, whole - job.elapsed))
    return Left(max(sum(shared) / cores, *shared) + sum(alone), cores)


def took(benchmark: Path) -> float | None:
    """Return the seconds in one of Snakemake's benchmark files, None if there is none that is whole."""
    try:
        return float(text_of(benchmark, _LARGEST_BENCHMARK).splitlines()[1].split("\t")[0])
    except (InputError, ValueError, IndexError):
        return None
