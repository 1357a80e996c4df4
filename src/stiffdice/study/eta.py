"""About how long what is left of a study takes, going by how long its jobs took so far."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import median
from typing import NamedTuple

from stiffdice.errors import InputError
from stiffdice.io.text_file import text_of

_LARGEST_BENCHMARK = 10_000  # bytes; two lines of numbers


class Job(NamedTuple):
    """What is known of how long one job takes; all times in seconds.

    kind: jobs of one kind take as long as their weight says. took: the job, when it last ended well, None if it never
    did. due: whether it is still to be made. elapsed: since it began, None if it is not running. progress: the fraction
    done, as told when it had run for `told`. alone: whether nothing runs beside it.
    """

    kind: str
    weight: float
    took: float | None
    due: bool
    elapsed: float | None = None
    progress: float = 0.0
    told: float = 0.0
    alone: bool = False

    @property
    def projected(self) -> float | None:
        """How long a running job takes in all, going by its progress."""
        return self.told / self.progress if self.elapsed is not None and self.progress > 0 else None


class Left(NamedTuple):
    """seconds: about how long what is left takes on `cores` cores, without `unknown` jobs whose like never ended."""

    seconds: float
    unknown: int
    cores: int


def of(jobs: Sequence[Job], cores: int, pace: float | None = None) -> Left:
    """Return about how long the jobs that are due take; `cores` of them at a time, those that are `alone` one by one.

    A job takes as long as it took before; one that never ended, as its progress says, or as the median of its kind. Of
    a kind of which none ended, nothing is known, unless weights are of one scale for all kinds: `pace` [s] for each.
    """
    rates = _rates(jobs)
    remaining = [(job, _remaining(job, rates.get(job.kind, pace))) for job in jobs if job.due]
    shared = [seconds for job, seconds in remaining if seconds is not None and not job.alone]
    alone = [seconds for job, seconds in remaining if seconds is not None and job.alone]
    seconds = max(sum(shared) / cores, max(shared, default=0.0)) + sum(alone)
    return Left(seconds, sum(seconds is None for _, seconds in remaining), cores)


def _rates(jobs: Iterable[Job]) -> dict[str, float]:
    """Return seconds per weight by kind."""
    found: dict[str, list[float]] = {}
    for job in jobs:
        took = job.took if job.projected is None else job.projected
        if took is not None:
            found.setdefault(job.kind, []).append(took / job.weight)
    return {kind: median(rates) for kind, rates in found.items()}


def _remaining(job: Job, rate: float | None) -> float | None:
    """Return the seconds until a job is done, None if unknown: nothing like it has ended, or it takes longer.

    rate [s]: for each of its weight, None if unknown.
    """
    whole = job.took if job.projected is None else job.projected
    if whole is None and rate is not None:
        whole = rate * job.weight
    if whole is None or job.elapsed is None:
        return whole
    return whole - job.elapsed if whole > job.elapsed else None


def took(benchmark: Path) -> float | None:
    """Return the seconds in one of Snakemake's benchmark files, None if there is none that is whole."""
    try:
        return float(text_of(benchmark, _LARGEST_BENCHMARK).splitlines()[1].split("\t")[0])
    except (InputError, ValueError, IndexError):
        return None
