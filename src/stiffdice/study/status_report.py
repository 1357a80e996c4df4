"""How far a study is, for people and for programs; and what failed, for the end of a run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import datetime
from pathlib import PurePosixPath
from typing import Any

from stiffdice.errors import printable
from stiffdice.study.disk_usage import Use
from stiffdice.study.status import Cells, Standing, State, Status

_LABEL = 12
# More names than that are counted instead.
_MOST = 8


def as_line(status: Status) -> str:
    """Return how far a study is, in one line."""
    parts = [_counts(status), *(f"{_share(cells)} cells" for cells in [_all_cells(status)] if cells.planned)]
    if status.state is not State.DONE:
        parts.append(f"time left {_left(status)}")
    return f"{status.study.name}: {'; '.join([*parts, _bytes(status.use.total)])}"


def as_text(status: Status) -> str:
    """Return a page: what is done, what runs, what failed and why, what is left to do, what it takes on disk."""
    lines = [f"{status.study.name}: {status.study.question}", "", _row("results", _counts(status))]
    if status.state is not State.DONE:
        lines.append(_row("time left", _left(status)))
    lines += [_row(label, text) for label, text in _of_cells(status)]
    lines += ["", *_stages(status)]
    for state in (State.RUNNING, State.INTERRUPTED, State.FAILED):
        lines += _listed(status, state)
    stale = status.those(State.STALE)
    if stale:
        lines += ["", "stale: the same command makes again"]
    for reason in dict.fromkeys(standing.reason for standing in stale):
        lines.append(f"  {_names([standing for standing in stale if standing.reason == reason])}  {reason}")
    if status.stuck:
        lines += ["", f"not made because of that: {_names(status.stuck)}"]
    lines += ["", *_disk(status.use, sum(cells.runs for cells in status.cells.values()))]
    lines += [line for told in status.study.left_out for line in ("", told)]
    return "\n".join(map(printable, lines))


def as_data(status: Status) -> dict[str, Any]:
    """Return the same for programs, as JSON has it: times in UTC (ISO 8601), durations in seconds, sizes in bytes."""
    return {
        "study": status.study.name,
        "state": status.state,
        "when": _iso(status.when),
        "results": {state: len(status.those(state)) for state in State},
        "cells": {name: cells._asdict() for name, cells in status.cells.items()},
        "left": status.left._asdict(),
        "jobs": [_job(status, standing) for standing in status.standings],
        "not_made": [_name(standing) for standing in status.stuck],
        "bytes": {
            "total": status.use.total,
            **status.use.kinds,
            "stale_shards": status.use.stale,
            "damaged": status.use.damaged,
            "unfinished": [part._asdict() for part in status.use.unfinished],
        },
        "left_out": list(status.study.left_out),
    }


def failures(status: Status) -> str:
    """Return what failed or was interrupted, each with its reason and its log, and what was not made; empty if all is.

    Meant for the end of a run, when nothing is under way.
    """
    lines = []
    for standing in status.those(State.FAILED, State.INTERRUPTED):
        lines += _told(status, standing)
    if status.stuck:
        lines.append(f"  not made because of that: {_names(status.stuck)}")
    if status.ready:
        lines.append(f"  not made, and no log says why: {_names(status.ready)}")
    return "\n".join(map(printable, lines))


def _row(label: str, text: str) -> str:
    return f"{label.ljust(_LABEL)}{text}"


def _counts(status: Status) -> str:
    done, every = len(status.those(State.DONE)), len(status.standings)
    others = [(len(status.those(state)), state) for state in State if state is not State.DONE]
    return ", ".join([f"{done} of {every} done", *(f"{count} {state}" for count, state in others if count)])


def _all_cells(status: Status) -> Cells:
    every = list(status.cells.values())
    counts = (sum(getattr(cells, name) for cells in every) for name in ("planned", "done", "running", "failed", "runs"))
    planned, done, running, failed, runs = counts
    return Cells(planned, any(cells.at_least for cells in every), done, running, failed, runs)


def _share(cells: Cells) -> str:
    return f"{cells.done:,} of {'at least ' if cells.at_least else ''}{cells.planned:,}"


def _of_cells(status: Status) -> Iterable[tuple[str, str]]:
    for name, cells in status.cells.items():
        others = ((cells.running, "running"), (cells.failed, "failed or interrupted"))
        parts = [f"{count:,} {word}" for count, word in others if count]
        yield "cells", ", ".join([f"{name}: {_share(cells)} done ({cells.runs:,} runs)", *parts])


def _left(status: Status) -> str:
    left, idle = status.left, "" if status.those(State.RUNNING) else ", nothing is running"
    if not left.seconds:
        return f"unknown so far{idle}"
    more = f" and {_many(left.unknown, 'job')} of unknown length" if left.unknown else ""
    return f"about {duration(left.seconds)}{more} on {_many(left.cores, 'core')}{idle}"


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _stages(status: Status) -> list[str]:
    """Return a line for each stage: how many of its results are done, and how it stands with the others."""
    lines = []
    for stage in dict.fromkeys(standing.result.stage for standing in status.standings):
        of = [standing.state for standing in status.standings if standing.result.stage == stage]
        others = [f"{of.count(state)} {state}" for state in State if state is not State.DONE and state in of]
        lines.append(_row(stage, ", ".join([f"{of.count(State.DONE)} of {len(of)} done", *others])))
    return lines


def _listed(status: Status, state: State) -> list[str]:
    found = status.those(state)
    if not found:
        return []
    lines = ["", str(state)]
    for standing in found:
        if state is State.RUNNING:
            lines.append(f"  {_name(standing)}  {_since(standing, status.when)}")
        else:
            lines += _told(status, standing)
    return lines


def _since(standing: Standing, now: datetime) -> str:
    parts = []
    if standing.begun is not None:
        parts.append(f"for {duration((now - standing.begun).total_seconds())}")
    if standing.progress:
        parts.append(f"{standing.progress:.0%} done")
    return ", ".join([*parts, *([standing.reason] if standing.reason else [])])


def _told(status: Status, standing: Standing) -> list[str]:
    log = PurePosixPath("results", status.study.name, standing.result.log)
    return [f"  {_name(standing)}  {standing.reason}", f"    log: {log}"]


def _name(standing: Standing) -> str:
    return f"{standing.result.stage} {standing.result.name}"


def _names(standings: Sequence[Standing]) -> str:
    named = [_name(standing) for standing in standings[:_MOST]]
    return ", ".join([*named, *([f"and {len(standings) - _MOST} more"] if len(standings) > _MOST else [])])


def _disk(use: Use, runs: int) -> list[str]:
    """Return what a study takes on disk, and what lies there that no result is; runs: those in its shards."""
    sizes = {**use.kinds, "unfinished": sum(part.size for part in use.unfinished)}
    kinds = ", ".join(f"{kind} {_bytes(size)}" for kind, size in sizes.items() if size)
    lines = [_row("disk", f"{_bytes(use.total)}{': ' if kinds else ''}{kinds}")]
    if runs:
        lines.append(_row("a run", f"{use.planned / runs:.3g} bytes in the shards"))
    if use.stale:
        size = _bytes(sum(use.stale.values()))
        lines.append(_row("stale", f"{_many(len(use.stale), 'shard')} of other grids, {size}"))
    for part in use.unfinished:
        if not part.alive:
            whose = f"of process {part.process}, which does not run on this host"
            lines.append(_row("leftover", f"{part.path}, {_bytes(part.size)}, {whose}"))
    lines += [_row("damaged", f"{path}, {_bytes(size)}: set aside") for path, size in use.damaged.items()]
    return lines


def _bytes(size: int) -> str:
    """Return a size in decimal units."""
    for unit, least in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= least:
            return f"{size / least:.3g} {unit}"
    return f"{size} bytes"


def duration(seconds: float) -> str:
    """Return a duration in seconds, minutes or hours, to the precision that an estimate has."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def _iso(when: datetime | None) -> str | None:
    return None if when is None else when.strftime("%Y-%m-%dT%H:%M:%SZ")


def _job(status: Status, standing: Standing) -> dict[str, Any]:
    result = standing.result
    told: dict[str, Any] = {"stage": result.stage, "name": result.name, "state": standing.state}
    told |= {"files": list(result.files), "log": result.log}
    if standing.reason:
        told["reason"] = standing.reason
    if standing.begun is not None:
        told["begun"] = _iso(standing.begun)
    return told | ({"progress": standing.progress} if standing.state is State.RUNNING else {})
