"""How far a study is: which of its results are done, which failed and why, and what is left to do.

Told from the jobs' logs and the files under results/STUDY, of which only digests are read: quick, and safe while
jobs are at work. What was asked of a result when it was made, its log says (`asked`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from stiffdice.study import disk_usage, eta, forecast, job_log, outputs, provenance
from stiffdice.study.config import Study
from stiffdice.study.outputs import Result
from stiffdice.sweep import partition
from stiffdice.sweep.grid import Sweep


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


ENDED = (State.FAILED, State.INTERRUPTED)  # before they were done


class Standing(NamedTuple):
    """One result, how it stands with it, and what its log says.

    reason: why it failed or was interrupted, or what is other in what was asked of a stale one; of one that runs, what
    is not known.
    """

    result: Result
    state: State
    reason: str = ""
    log: job_log.Told | None = None


class Cells(NamedTuple):
    """The cells of a sweep: counted where the log of a finished shard says how many, else those of the first scans.

    done: in shards that are done, and the share of running ones that is. running: the rest of these. failed: in shards
    that failed or were interrupted. runs: in shards that are done. at_least: whether refined scans may have more.
    """

    planned: int
    done: int
    running: int
    failed: int
    runs: int
    at_least: bool


@dataclass(frozen=True)
class Status:
    """How far a study is. when: it was looked at (UTC). cells: by sweep. left: of time, for what is not done.

    stuck: not made because something that they stand on failed or was interrupted. ready: waiting or stale, though all
    that they stand on is done.
    """

    study: Study
    when: datetime
    standings: Sequence[Standing]
    stuck: Sequence[Standing]
    ready: Sequence[Standing]
    cells: Mapping[str, Cells]
    left: eta.Left
    use: disk_usage.Use

    def those(self, *states: State) -> list[Standing]:
        """Return the results of which one of these is true."""
        return [standing for standing in self.standings if standing.state in states]

    @property
    def state(self) -> State:
        """The study's: failed if any result is, running if any job is, done if all are."""
        order = (State.FAILED, State.RUNNING, State.INTERRUPTED, State.STALE, State.WAITING)
        return next((state for state in order if self.those(state)), State.DONE)


def of(study: Study, folder: Path, cores: int | None = None) -> Status:
    """Return how far a study is; to be called in the project's folder.

    folder: results/STUDY, there or not. cores: for the time left; by default as many as jobs are running.
    """
    below, found, lost = outputs.needs(study), dict[Result, Standing](), dict[Result, Standing]()
    stale, ready = provenance.stale(provenance.of(study), folder), []
    for result, parts in below.items():
        standing, stands = _alone(result, folder), all(found[part].state is State.DONE for part in parts)
        if standing.state is State.DONE and result in stale:
            standing = standing._replace(state=State.STALE, reason=stale[result])
        elif standing.state is State.DONE and not stands:
            standing = standing._replace(state=State.WAITING)  # its files are there, and will be made again
        found[result] = standing
        if standing.state in ENDED or not lost.keys().isdisjoint(parts):
            lost[result] = standing
        elif standing.state in (State.WAITING, State.STALE) and stands:
            ready.append(standing)
    standings = list(found.values())
    return Status(
        study=study,
        when=datetime.now(UTC),
        standings=standings,
        stuck=[standing for standing in lost.values() if standing.state not in ENDED],
        ready=ready,
        cells={name: _cells(name, sweep, standings) for name, sweep in study.sweeps.items()},
        left=_left(study, folder, standings, lost, cores),
        use=disk_usage.of(folder, {file for result in found if result.stage == "shard" for file in result.files}),
    )


def _alone(result: Result, folder: Path) -> Standing:
    """Return how it stands with a result, whatever it stands on."""
    paths = [folder / file for file in result.files]
    reason = outputs.dangling(result, folder)
    for path in paths:
        if path.exists() and not path.is_file():
            reason = f"{path}: is in the way: not a regular file"
    try:
        made = min(path.stat().st_mtime for path in paths)
    except OSError:
        made = 0.0
    log = job_log.read(folder / result.log)
    state, reason = (State.FAILED, reason) if reason else _told(log, made)
    return Standing(result, state, reason, log)


def _told(log: job_log.Told | None, made: float) -> tuple[State, str]:
    """Return what a log says of its result, and why; made: when the oldest of its files was [s], 0 if not there."""
    there = State.DONE if made else State.WAITING
    if log is None or log.ending == "done" or (made and (log.begun is None or made > log.written.timestamp())):
        return there, ""
    if log.ending:
        return State(log.ending), log.reason
    last = f"{log.written:%Y-%m-%d %H:%M:%S} UTC"
    found = State.INTERRUPTED, f"ended without a word; killed? (its log stops at {last})"
    if log.empty:
        found = State.INTERRUPTED, "its log is empty; killed at its start, or no room on the disk?"
    elif log.begun is None:  # of a version whose logs did not say
        found = State.WAITING, ""
    elif not job_log.is_here(log):
        found = State.RUNNING, f"on {log.host}: whether it still runs is not known here"
    elif job_log.is_alive(log):
        found = State.RUNNING, ""
    elif made >= log.begun.timestamp():
        found = State.DONE, ""
    return found


def _cells(name: str, sweep: Sweep, standings: Sequence[Standing]) -> Cells:
    plan, rows, at_least = partition.of(sweep), [], False
    for result, state, _, log in standings:
        of, _, shard = result.name.partition("/")
        if result.stage != "shard" or of != name:
            continue
        count = None if log is None or state is not State.DONE else log.cells
        if count is None:
            count = sum(len(piece.steps) for piece in plan[shard].pieces)
            at_least |= plan[shard].round > 0
        done = count * (log.progress if log and state is State.RUNNING else float(state is State.DONE))
        running, failed = (count - done) * (state is State.RUNNING), count * (state in ENDED)
        rows.append((count, done, running, failed, count * sweep.members * (state is State.DONE)))
    planned, done, running, failed, runs = (int(sum(column)) for column in zip(*rows, strict=True))
    return Cells(planned, done, running, failed, runs, at_least)


def _left(
    study: Study, folder: Path, standings: Sequence[Standing], lost: Collection[Result], cores: int | None
) -> eta.Left:
    """Return the time left: of what the run that is under way still makes, or if none is of all that is not done."""
    running = sum(standing.state is State.RUNNING for standing in standings)
    weights, jobs = forecast.seconds(study), []
    for result, state, _, log in standings:
        due = state is not State.DONE and not (running and result in lost)
        took = eta.took(folder / result.benchmark)
        jobs.append(eta.job(result, weights[result], log if state is State.RUNNING else None, due=due, took=took))
    return eta.of(jobs, cores or max(1, running), forecast.slowness())
