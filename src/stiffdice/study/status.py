"""How far a study is: which of its results are done, which failed and why, and what is left to do; for people, too.

Told from the jobs' logs and the files under results/STUDY, of which only digests are read: quick, and safe while
jobs are at work. What was asked of a result when it was made, its log says (`asked`).
"""

from __future__ import annotations

import contextlib
import os
import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

from stiffdice.errors import printable
from stiffdice.study import forecast, job_log, outputs
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

# Files by kind, their paths relative to results/STUDY; what is none of these is `other`.
_KIND = re.compile("sweeps/[^/]+/(shards)/[^/]+|(runs|sweeps|experiments|figures|tables|benchmarks|logs)/.+")
# What io.writer calls a file that is not finished: .NAME.HOST.PROCESS.part
_PART = re.compile(r"(?:.*/)?\.[^/]+\.(\d{1,10})\.part")

# More names than that are counted instead.
_MOST = 8


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


@dataclass(frozen=True)
class Status:
    """How far a study is. when: it was looked at (UTC). cells: by sweep.

    stuck: not made because something that they stand on failed or was interrupted. ready: waiting or stale, though all
    that they stand on is done. left: about how long [s] it takes on `cores` cores to make what is not done, or while a
    run is under way, what that still makes.
    """

    study: Study
    when: datetime
    standings: Sequence[Standing]
    stuck: Sequence[Standing]
    ready: Sequence[Standing]
    cells: Mapping[str, Cells]
    left: float
    cores: int
    use: Use

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
    found, lost, ready = dict[Result, Standing](), dict[Result, Standing](), []
    stale = outputs.stale(outputs.asked(study), folder)
    for result, parts in outputs.needs(study).items():
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
    running = sum(standing.state is State.RUNNING for standing in standings)
    weights, jobs = forecast.seconds(study), []
    for result, state, _, log in standings:
        due = state is not State.DONE and not (running and result in lost)
        told, took = log if state is State.RUNNING else None, job_log.took(folder / result.benchmark)
        jobs.append(forecast.Job(forecast.kind_of(study, result), weights[result], took, due, told))
    cores = cores or max(1, running)
    return Status(
        study=study,
        when=datetime.now(UTC),
        standings=standings,
        stuck=[standing for standing in lost.values() if standing.state not in ENDED],
        ready=ready,
        cells={name: _cells(name, sweep, standings) for name, sweep in study.sweeps.items()},
        left=forecast.left(jobs, cores, forecast.slowness()),
        cores=cores,
        use=use_of(folder, {file for result in found if result.stage == "shard" for file in result.files}),
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
    if log.begun is None:  # of a version whose logs did not say, unless it is empty
        empty = State.INTERRUPTED, "its log is empty; killed at its start, or no room on the disk?"
        return empty if log.empty else (State.WAITING, "")
    alive = job_log.is_alive(log)
    if alive or alive is None:
        return State.RUNNING, "" if alive else f"on {log.host}: whether it still runs is not known here"
    last = f"{log.written:%Y-%m-%d %H:%M:%S} UTC"
    killed = State.INTERRUPTED, f"ended without a word; killed? (its log stops at {last})"
    return (State.DONE, "") if made >= log.begun.timestamp() else killed


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


def use_of(folder: Path, shards: Collection[str]) -> Use:
    """Return what the files of a study take, links not followed; shards: those planned, relative to its folder."""
    sizes: dict[str, int] = {}
    for top, _, names in os.walk(folder):
        for path in (Path(top, name) for name in names):
            with contextlib.suppress(OSError):  # it vanished meanwhile
                sizes[path.relative_to(folder).as_posix()] = path.lstat().st_size
    kinds, stale, leftover, damaged = Counter[str](), dict[str, int](), dict[str, int](), dict[str, int]()
    for name, size in sorted(sizes.items()):
        part, kind = _PART.fullmatch(name), _KIND.fullmatch(name)
        word = "unfinished" if part else kind[kind.lastindex or 0] if kind else "other"
        kinds[word] += size
        if name.endswith(".damaged"):
            damaged[name] = size
        elif word == "shards" and name not in shards:
            stale[name] = size
        elif part and job_log.started_at(int(part[1])) is None:
            leftover[name] = size
    return Use(kinds, stale, leftover, damaged)


def as_line(status: Status) -> str:
    """Return how far a study is, in one line."""
    left = [] if status.state is State.DONE else [f"time left {_left(status)}"]
    return f"{status.study.name}: {'; '.join([_counts(status.standings), *left, _bytes(status.use.total)])}"


def as_text(status: Status) -> str:
    """Return a page: what is done, what runs, what failed and why, what is left to do, what it takes on disk."""
    lines, use = [f"{status.study.name}: {status.study.question}", ""], status.use
    lines.append(f"{'results':12}{_counts(status.standings)}")
    lines += [f"{'time left':12}{_left(status)}"] if status.state is not State.DONE else []
    for name, cells in status.cells.items():
        whole = f"{cells.done:,} of {'at least ' if cells.at_least else ''}{cells.planned:,} done ({cells.runs:,} runs)"
        others = ((cells.running, "running"), (cells.failed, "failed or interrupted"))
        parts = [f"{count:,} {word}" for count, word in others if count]
        lines.append(f"{'cells':12}{', '.join([f'{name}: {whole}', *parts])}")
    lines.append("")
    for stage in dict.fromkeys(standing.result.stage for standing in status.standings):
        lines.append(f"{stage:12}{_counts([part for part in status.standings if part.result.stage == stage])}")
    for state in (State.RUNNING, State.INTERRUPTED, State.FAILED):
        if found := status.those(state):
            lines += ["", str(state), *(line for standing in found for line in _lines(status, standing))]
    if stale := status.those(State.STALE):
        lines += ["", "stale: the same command makes again"]
        for reason in dict.fromkeys(standing.reason for standing in stale):
            lines.append(f"  {_names([standing for standing in stale if standing.reason == reason])}  {reason}")
    if status.stuck:
        lines += ["", f"not made because of that: {_names(status.stuck)}"]
    lines += ["", f"{'disk':12}{': '.join(filter(None, [_bytes(use.total), ', '.join(_sizes(use.kinds))]))}"]
    if use.stale:
        lines.append(f"{'stale':12}shards of other grids: {len(use.stale)}, {_bytes(sum(use.stale.values()))}")
    gone = "of a process that does not run on this host"
    lines += [f"{'leftover':12}{told}, {gone}" for told in _sizes(use.leftover)]
    lines += [f"{'damaged':12}{told}, set aside" for told in _sizes(use.damaged)]
    lines += [line for told in status.study.left_out for line in ("", told)]
    return "\n".join(map(printable, lines))


def as_data(status: Status) -> dict[str, Any]:
    """Return the same for programs, as JSON has it: times in UTC (ISO 8601), durations in seconds, sizes in bytes."""
    use = status.use
    others = {"stale_shards": use.stale, "damaged": use.damaged, "leftover": use.leftover}
    return {
        "study": status.study.name,
        "state": status.state,
        "when": f"{status.when:%Y-%m-%dT%H:%M:%SZ}",
        "results": {state: len(status.those(state)) for state in State},
        "cells": {name: cells._asdict() for name, cells in status.cells.items()},
        "left": {"seconds": status.left, "cores": status.cores},
        "jobs": [_job(standing) for standing in status.standings],
        "not_made": [_name(standing) for standing in status.stuck],
        "bytes": {"total": use.total, **use.kinds, **others},
        "left_out": list(status.study.left_out),
    }


def failures(status: Status) -> str:
    """Return what failed or was interrupted, each with its reason and its log, and what was not made; empty if all is.

    Meant for the end of a run, when nothing is under way.
    """
    lines = [line for standing in status.those(*ENDED) for line in _lines(status, standing)]
    if status.stuck:
        lines.append(f"  not made because of that: {_names(status.stuck)}")
    if status.ready:
        lines.append(f"  not made, and no log says why: {_names(status.ready)}")
    return "\n".join(map(printable, lines))


def _counts(standings: Sequence[Standing]) -> str:
    """Return how many results are done, and how it stands with the others."""
    states = [standing.state for standing in standings]
    others = [f"{states.count(state)} {state}" for state in State if state is not State.DONE and state in states]
    return ", ".join([f"{states.count(State.DONE)} of {len(states)} done", *others])


def _left(status: Status) -> str:
    idle = "" if status.those(State.RUNNING) else ", nothing is running"
    return f"about {duration(status.left)} on {status.cores} core{'' if status.cores == 1 else 's'}{idle}"


def _lines(status: Status, standing: Standing) -> list[str]:
    """Return what is to be said of a result whose job runs, or ended before it was done."""
    result, state, reason, log = standing
    if state is not State.RUNNING or log is None or log.begun is None:
        path = PurePosixPath("results", status.study.name, result.log)
        return [f"  {_name(standing)}  {reason}", f"    log: {path}"]
    parts = [f"for {duration((status.when - log.begun).total_seconds())}"]
    parts += [f"{log.progress:.0%} done"] if log.progress else []
    return [f"  {_name(standing)}  {', '.join([*parts, *filter(None, [reason])])}"]


def _name(standing: Standing) -> str:
    return f"{standing.result.stage} {standing.result.name}"


def _names(standings: Sequence[Standing]) -> str:
    more = [f"and {len(standings) - _MOST} more"] if len(standings) > _MOST else []
    return ", ".join([*map(_name, standings[:_MOST]), *more])


def _sizes(sizes: Mapping[str, int]) -> list[str]:
    return [f"{name} {_bytes(size)}" for name, size in sizes.items()]


def _bytes(size: int) -> str:
    for unit, least in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= least:
            return f"{size / least:.3g} {unit}"
    return f"{size} bytes"


def duration(seconds: float) -> str:
    """Return a duration in seconds, minutes or hours, to the precision that an estimate has."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def _job(standing: Standing) -> dict[str, Any]:
    result, state, reason, log = standing
    told = result._asdict() | {"log": result.log, "state": state}
    if reason:
        told["reason"] = reason
    if log and log.begun:
        told["begun"] = f"{log.begun:%Y-%m-%dT%H:%M:%SZ}"
    return told | ({"progress": log.progress} if log and state is State.RUNNING else {})
