"""How far a study is, for people and for programs; and what failed, for the end of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import PurePosixPath
from typing import Any

from stiffdice.errors import printable
from stiffdice.study.disk_usage import Use
from stiffdice.study.status import ENDED, Standing, State, Status

# More names than that are counted instead.
_MOST = 8


def as_line(status: Status) -> str:
    """Return how far a study is, in one line."""
    left = [] if status.state is State.DONE else [f"time left {_left(status)}"]
    return f"{status.study.name}: {'; '.join([_counts(status.standings), *left, _bytes(status.use.total)])}"


def as_text(status: Status) -> str:
    """Return a page: what is done, what runs, what failed and why, what is left to do, what it takes on disk."""
    lines = [f"{status.study.name}: {status.study.question}", "", _row("results", _counts(status.standings))]
    if status.state is not State.DONE:
        lines.append(_row("time left", _left(status)))
    for name, cells in status.cells.items():
        whole = f"{cells.done:,} of {'at least ' if cells.at_least else ''}{cells.planned:,} done ({cells.runs:,} runs)"
        others = ((cells.running, "running"), (cells.failed, "failed or interrupted"))
        parts = [f"{name}: {whole}", *(f"{count:,} {word}" for count, word in others if count)]
        lines.append(_row("cells", ", ".join(parts)))
    lines.append("")
    for stage in dict.fromkeys(standing.result.stage for standing in status.standings):
        lines.append(_row(stage, _counts([part for part in status.standings if part.result.stage == stage])))
    for state in (State.RUNNING, State.INTERRUPTED, State.FAILED):
        if found := status.those(state):
            lines += ["", str(state), *(line for standing in found for line in _told(status, standing))]
    if stale := status.those(State.STALE):
        lines += ["", "stale: the same command makes again"]
        for reason in dict.fromkeys(standing.reason for standing in stale):
            lines.append(f"  {_names([standing for standing in stale if standing.reason == reason])}  {reason}")
    if status.stuck:
        lines += ["", f"not made because of that: {_names(status.stuck)}"]
    lines += ["", *_disk(status.use)]
    lines += [line for told in status.study.left_out for line in ("", told)]
    return "\n".join(map(printable, lines))


def as_data(status: Status) -> dict[str, Any]:
    """Return the same for programs, as JSON has it: times in UTC (ISO 8601), durations in seconds, sizes in bytes."""
    use = status.use
    others = {"stale_shards": use.stale, "damaged": use.damaged, "leftover": use.leftover}
    return {
        "study": status.study.name,
        "state": status.state,
        "when": _iso(status.when),
        "results": {state: len(status.those(state)) for state in State},
        "cells": {name: cells._asdict() for name, cells in status.cells.items()},
        "left": status.left._asdict(),
        "jobs": [_job(standing) for standing in status.standings],
        "not_made": [_name(standing) for standing in status.stuck],
        "bytes": {"total": use.total, **use.kinds, **others},
        "left_out": list(status.study.left_out),
    }


def failures(status: Status) -> str:
    """Return what failed or was interrupted, each with its reason and its log, and what was not made; empty if all is.

    Meant for the end of a run, when nothing is under way.
    """
    lines = [line for standing in status.those(*ENDED) for line in _told(status, standing)]
    if status.stuck:
        lines.append(f"  not made because of that: {_names(status.stuck)}")
    if status.ready:
        lines.append(f"  not made, and no log says why: {_names(status.ready)}")
    return "\n".join(map(printable, lines))


def _row(label: str, text: str) -> str:
    return f"{label:12}{text}"


def _counts(standings: Sequence[Standing]) -> str:
    """Return how many results are done, and how it stands with the others."""
    states = [standing.state for standing in standings]
    others = [f"{states.count(state)} {state}" for state in State if state is not State.DONE and state in states]
    return ", ".join([f"{states.count(State.DONE)} of {len(states)} done", *others])


def _left(status: Status) -> str:
    seconds, cores = status.left
    idle = "" if status.those(State.RUNNING) else ", nothing is running"
    return f"about {duration(seconds)} on {cores} core{'' if cores == 1 else 's'}{idle}"


def _told(status: Status, standing: Standing) -> list[str]:
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


def _disk(use: Use) -> list[str]:
    lines = [_row("disk", ": ".join(filter(None, [_bytes(use.total), ", ".join(_sizes(use.kinds))])))]
    if use.stale:
        lines.append(_row("stale", f"shards of other grids: {len(use.stale)}, {_bytes(sum(use.stale.values()))}"))
    lines += [_row("leftover", f"{told}, of a process that does not run on this host") for told in _sizes(use.leftover)]
    return lines + [_row("damaged", f"{told}, set aside") for told in _sizes(use.damaged)]


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


def _iso(when: datetime) -> str:
    return when.strftime("%Y-%m-%dT%H:%M:%SZ")


def _job(standing: Standing) -> dict[str, Any]:
    result, state, reason, log = standing
    told = result._asdict() | {"log": result.log, "state": state}
    if reason:
        told["reason"] = reason
    if log and log.begun:
        told["begun"] = _iso(log.begun)
    return told | ({"progress": log.progress} if log and state is State.RUNNING else {})
