"""How far a study is: which of its results are done, which failed and why, and what is left to do.

Told from the jobs' logs and the files under results/STUDY, of which only digests are read: quick, and safe while
jobs are at work. What was asked of a result when it was made, its log says (`asked`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from stat import S_ISREG
from typing import NamedTuple

from stiffdice.study import disk_usage, eta, job_log, outputs, provenance
from stiffdice.study.config import Study
from stiffdice.study.outputs import Result
from stiffdice.sweep import partition as shards
from stiffdice.sweep.grid import Sweep
from stiffdice.sweep.partition import Shard


class State(StrEnum):
    """How it stands with one result.

    DONE: its files are there, whole, and so is all that it stands on. RUNNING: its job has begun, and has not ended.
    INTERRUPTED: its job was told to stop, or ended without a word. FAILED: its job ended by an error. WAITING: its job
    has not begun. STALE: its files are there, but something else was asked when they were made.
    """

    DONE = "done"
    RUNNING = "running"
    INTERRUPTED = "interrupted"
    STALE = "stale"
    FAILED = "failed"
    WAITING = "waiting"


class Standing(NamedTuple):
    """One result, and how it stands with it.

    reason: why it failed or was interrupted, or what is other in what was asked of a stale one; of one that runs, what
    is not known. begun: when its job did (UTC). progress: fraction of a running job that is done, as of `told` (UTC).
    cells: in a shard that is done, if its log says.
    """

    result: Result
    state: State
    reason: str = ""
    begun: datetime | None = None
    progress: float = 0.0
    told: datetime | None = None
    cells: int | None = None


class Cells(NamedTuple):
    """The cells of a sweep: counted where the log of a finished shard says how many, else those of the first scans.

    at_least: whether refined scans may have more. done: in shards that are done, and the share of running ones that
    is. running: the rest of these. failed: in shards that failed or were interrupted. runs: in shards that are done.
    """

    planned: int
    at_least: bool
    done: int
    running: int
    failed: int
    runs: int


@dataclass(frozen=True)
class Status:
    """How far a study is. when: it was looked at (UTC). cells: by sweep. left: of time, for what is not done."""

    study: Study
    when: datetime
    standings: tuple[Standing, ...]
    cells: Mapping[str, Cells]
    left: eta.Left
    use: disk_usage.Use

    def those(self, *states: State) -> list[Standing]:
        """Return the results of which one of these is true."""
        return [standing for standing in self.standings if standing.state in states]

    @property
    def state(self) -> State:
        """The study's: failed if any result is, running if any job is, done if all are."""
        found = {standing.state for standing in self.standings}
        for state in (State.FAILED, State.RUNNING, State.INTERRUPTED, State.STALE, State.WAITING):
            if state in found:
                return state
        return State.DONE

    @property
    def ready(self) -> list[Standing]:
        """Results that wait or are stale, though all that they stand on is done."""
        done, below = {standing.result for standing in self.those(State.DONE)}, outputs.needs(self.study)
        return [
            standing for standing in self.those(State.WAITING, State.STALE) if done.issuperset(below[standing.result])
        ]

    @property
    def stuck(self) -> list[Standing]:
        """Results that are not made because something that they stand on failed or was interrupted."""
        return _stuck(self.standings, outputs.needs(self.study))


def _stuck(standings: Iterable[Standing], below: Mapping[Result, tuple[Result, ...]]) -> list[Standing]:
    ended, found = set(), []
    for standing in standings:  # in the order in which one stands on another
        if standing.state in (State.FAILED, State.INTERRUPTED):
            ended.add(standing.result)
        elif ended.intersection(below[standing.result]):
            ended.add(standing.result)
            found.append(standing)
    return found


def of(study: Study, folder: Path, cores: int | None = None) -> Status:
    """Return how far a study is; to be called in the project's folder.

    folder: results/STUDY, there or not. cores: for the time left; by default as many as jobs are running.
    """
    below, standings, plans = outputs.needs(study), dict[Result, Standing](), _plans(study)
    stale = provenance.stale(provenance.of(study), folder)
    for result in below:
        standing = _alone(result, folder)
        if standing.state is State.DONE and result in stale:
            standing = Standing(result, State.STALE, stale[result])
        elif standing.state is State.DONE and any(standings[part].state is not State.DONE for part in below[result]):
            standing = Standing(result, State.WAITING)  # its files are there, and will be made again
        standings[result] = standing
    every = tuple(standings.values())
    stuck = {standing.result for standing in _stuck(every, below)}
    return Status(
        study=study,
        when=(now := datetime.now(UTC)),
        standings=every,
        cells={name: _cells(sweep, plans[name], every) for name, sweep in study.sweeps.items()},
        left=_left(plans, folder, every, stuck, now, cores),
        use=disk_usage.of(folder, {file for result in standings if result.stage == "shard" for file in result.files}),
    )


def _plans(study: Study) -> dict[str, dict[str, Shard]]:
    """Return the shards of each sweep, by the names of their results."""
    return {
        name: {f"{name}/{shard}": plan for shard, plan in shards.of(sweep).items()}
        for name, sweep in study.sweeps.items()
    }


def _alone(result: Result, folder: Path) -> Standing:
    """Return how it stands with a result, whatever it stands on."""
    told = job_log.read(folder / result.log)
    try:
        stats = [(folder / file).stat() for file in result.files]
    except OSError:
        stats = []
    for file, stat in zip(result.files, stats, strict=False):
        if not S_ISREG(stat.st_mode):
            return Standing(result, State.FAILED, f"{folder / file}: is in the way: not a regular file")
    if reason := outputs.dangling(result, folder):
        return Standing(result, State.FAILED, reason)
    if told is None:
        return Standing(result, State.DONE if stats else State.WAITING)
    made = bool(stats) and min(stat.st_mtime for stat in stats)
    return _as_told(result, told, made)


def _as_told(result: Result, told: job_log.Told, made: float) -> Standing:
    """Return how it stands with a result that has a log; made: when the oldest of its files was [s], 0 if not there."""
    if told.ending == "done" or (made and (told.begun is None or made > told.written.timestamp())):
        return Standing(result, State.DONE if made else State.WAITING, begun=told.begun, cells=told.cells)
    if told.ending:
        return Standing(result, State(told.ending), told.reason, told.begun)
    if told.begun is None:  # or of a version whose logs did not say
        empty = "its log is empty; killed at its start, or no room on the disk?"
        return Standing(result, State.INTERRUPTED, empty) if told.empty else Standing(result, State.WAITING)
    if not job_log.is_here(told) or job_log.is_alive(told):
        unseen = "" if job_log.is_here(told) else f"on {told.host}: whether it still runs is not known here"
        return Standing(result, State.RUNNING, unseen, told.begun, told.progress, told.written)
    if made >= told.begun.timestamp():
        return Standing(result, State.DONE, begun=told.begun, cells=told.cells)
    last = f"{told.written:%Y-%m-%d %H:%M:%S} UTC"
    return Standing(result, State.INTERRUPTED, f"ended without a word; killed? (its log stops at {last})", told.begun)


def _cells(sweep: Sweep, plan: Mapping[str, Shard], standings: Iterable[Standing]) -> Cells:
    sums = {"planned": 0.0, "done": 0.0, "running": 0.0, "failed": 0.0, "runs": 0.0}
    at_least = False
    for standing in standings:
        if standing.result.stage != "shard" or standing.result.name not in plan:
            continue
        shard = plan[standing.result.name]
        count = standing.cells
        if count is None:
            count = sum(len(piece.steps) for piece in shard.pieces)
            at_least |= shard.round > 0
        sums["planned"] += count
        match standing.state:
            case State.DONE:
                sums["done"] += count
                sums["runs"] += count * sweep.members
            case State.RUNNING:
                sums["done"] += standing.progress * count
                sums["running"] += (1 - standing.progress) * count
            case State.FAILED | State.INTERRUPTED:
                sums["failed"] += count
    return Cells(at_least=at_least, **{key: int(value) for key, value in sums.items()})


# Stages whose jobs are much alike; of others only what the same job took before is known.
_ALIKE = ("trajectory", "survey", "collect", "frontier", "figure", "table")


def _left(
    plans: Mapping[str, Mapping[str, Shard]],
    folder: Path,
    standings: Collection[Standing],
    stuck: Collection[Result],
    now: datetime,
    cores: int | None,
) -> eta.Left:
    """Return the time left: of what the run that is under way still makes, or if none is of all that is not done."""
    running = sum(standing.state is State.RUNNING for standing in standings)
    seconds = {name: shard.seconds for plan in plans.values() for name, shard in plan.items()}
    jobs = [_job(standing, seconds.get(standing.result.name, 1.0), folder, now) for standing in standings]
    if running:
        ended = [part.result in stuck or part.state in (State.FAILED, State.INTERRUPTED) for part in standings]
        jobs = [job._replace(due=job.due and not over) for job, over in zip(jobs, ended, strict=True)]
    return eta.of(jobs, cores or max(1, running))


def _job(standing: Standing, weight: float, folder: Path, now: datetime) -> eta.Job:
    """Return what is known of a result's job; weight: how long it takes, next to others of its kind."""
    result = standing.result
    kind = {"shard": f"shard {result.name.partition('/')[0]}"} | {stage: stage for stage in _ALIKE}
    job = eta.Job(
        kind=kind.get(result.stage, f"{result.stage} {result.name}"),
        weight=weight,
        took=eta.took(folder / result.benchmark),
        due=standing.state is not State.DONE,
        alone=result.stage == "timings",
    )
    if standing.state is not State.RUNNING or standing.begun is None or standing.told is None:
        return job
    elapsed, told = ((time - standing.begun).total_seconds() for time in (now, standing.told))
    return job._replace(elapsed=elapsed, progress=standing.progress, told=told)
