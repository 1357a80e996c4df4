"""What a finished study tells of itself: times and memory by Snakemake's benchmarks, files by their sizes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import median
from typing import NamedTuple

from benchmarks.scale.project import Taken
from stiffdice.io.reader import open_file
from stiffdice.study import outputs
from stiffdice.study.config import Study
from stiffdice.study.job_log import took

# What jobs' logs tell.
_SIMULATION, _CELLS = r"^simulation: ([0-9.]+) s$", r"^(\d+) cells, \d+ runs$"
_KEPT, _MEMORY = r"^of these, (\d+) cells kept ", r"^memory: (\d+) MB$"

# Stages that bring shards together.
_COLLECTING = ("collect", "survey")


class Job(NamedTuple):
    """One job that ended well, of a stage: wall time [s], of that in the simulator [s], peak memory [B].

    cells: in its shard, and of these kept from other shards; both 0 of any other job.
    """

    stage: str
    name: str
    seconds: float
    simulation: float
    peak: float
    cells: int
    kept: int


class Grown(NamedTuple):
    """One size, measured.

    runs, cells: collected. jobs: of all stages. shards: of them. cores, wall [s]: of the workflow from start to end, in
    `sessions` calls. simulation, in_jobs [s]: added up over jobs. longest [s]: of shards' jobs; balance: of one
    sweep's, over their median, where that is worst. shard_peak, collect_peak [B]: largest of any; NaN without a job.
    collecting [s]. shard_bytes, bytes, files: of results, logs and benchmarks apart. sweep_bytes: of sweep.h5.
    dag, verify (wall and processor time [s]; peak memory [B]): of a dry run before it began, of a check of all results.
    """

    runs: int
    cells: int
    jobs: int
    shards: int
    cores: int
    wall: float
    sessions: int
    simulation: float
    in_jobs: float
    longest: float
    balance: float
    shard_peak: float
    collect_peak: float
    collecting: float
    shard_bytes: int
    bytes: int
    files: int
    sweep_bytes: int
    dag: Taken
    verify: Taken


class Session(NamedTuple):
    """One call of the workflow: when it began [s since the epoch], and how long it took [s]; None if it was killed."""

    begun: float
    seconds: float | None


def jobs_of(study: Study, top: Path, since: float = 0.0) -> list[Job]:
    """Return the jobs of a study that ended after a time [s since the epoch]; top: where its results lie."""
    found = []
    for result in outputs.of(study):
        benchmark = top / result.benchmark
        seconds = took(benchmark)
        if seconds is not None and benchmark.stat().st_mtime >= since:
            text = (top / result.log).read_text(encoding="utf-8")
            told = [_first(pattern, text) for pattern in (_SIMULATION, _CELLS, _KEPT, _MEMORY)]
            found.append(Job(result.stage, result.name, seconds, told[0], told[3] * 1e6, int(told[1]), int(told[2])))
    return found


def _first(pattern: str, log: str) -> float:
    """Return the number that a log tells; 0 if it says nothing of it."""
    said = re.search(pattern, log, re.MULTILINE)
    return float(said[1]) if said else 0.0


def wall_of(sessions: Sequence[Session], top: Path) -> float:
    """Return the wall time of all sessions [s]; one that was killed lasted until a log was last written to."""
    total = 0.0
    for session, after in zip(sessions, [*sessions[1:], None], strict=True):
        if session.seconds is not None:
            total += session.seconds
            continue
        end = after.begun if after else float("inf")
        written = (path.stat().st_mtime for path in top.glob("logs/**/*.log"))
        total += max((time for time in written if session.begun <= time < end), default=session.begun) - session.begun
    return total


def measured(study: Study, top: Path, cores: int, wall: float, sessions: int, dag: Taken, verify: Taken) -> Grown:
    """Return what a finished study tells; top: where its results lie."""
    jobs, made = jobs_of(study, top), outputs.of(study)
    shards = [job for job in jobs if job.stage == "shard"]
    collects = [job for job in jobs if job.stage in _COLLECTING]
    sweeps = [top / "sweeps" / name / "sweep.h5" for name in study.sweeps]
    cells = {path: open_file(path).sizes["cell"] for path in sweeps}
    return Grown(
        runs=sum(cells[path] * sweep.members for path, sweep in zip(sweeps, study.sweeps.values(), strict=True)),
        cells=sum(cells.values()),
        jobs=len(made),
        shards=len(shards),
        cores=cores,
        wall=wall,
        sessions=sessions,
        simulation=sum(job.simulation for job in jobs),
        in_jobs=sum(job.seconds for job in jobs),
        longest=max(job.seconds for job in shards),
        balance=max(_balance([job for job in shards if job.name.startswith(f"{name}/")]) for name in study.sweeps),
        shard_peak=_largest(shards),
        collect_peak=_largest(collects),
        collecting=sum(job.seconds for job in collects),
        shard_bytes=_bytes(top / file for result in made if result.stage == "shard" for file in result.files),
        bytes=_bytes(top / file for result in made for file in result.files),
        files=sum(len(result.files) for result in made),
        sweep_bytes=_bytes(sweeps),
        dag=dag,
        verify=verify,
    )


def _balance(jobs: Sequence[Job]) -> float:
    """Return how many times as long as half of the jobs the longest takes."""
    return max(job.seconds for job in jobs) / median(job.seconds for job in jobs)


def _largest(jobs: Iterable[Job]) -> float:
    return max((job.peak for job in jobs), default=float("nan"))


def _bytes(paths: Iterable[Path]) -> int:
    return sum(path.stat().st_size for path in paths)
