"""About how long the jobs of a study take, told before any of them has run; and what is left, by how long others took.

Seconds are of one core of the machine that `cost` is of, otherwise idle; how this one compares, a sum of numbers in a
row says within a hundredth of a second (`slowness`), and what else runs on it, the system (`crowding`). What `cost`
does not predict takes as long as was measured once: a table, right as long as the options are as in config/. How good
it is: `docs/explanation/forecast.md`.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np

from stiffdice.dynamics.compiling.kernel_cache import cache_folder
from stiffdice.study import outputs
from stiffdice.study.catalogue import DRAWINGS
from stiffdice.study.config import Study
from stiffdice.study.job_log import Told
from stiffdice.study.outputs import Result
from stiffdice.sweep import partition as shards

# Of a job that the warm process takes, besides what it simulates: files, drawing. One of its own also imports, for 1 s.
_JOB = {
    **{"trajectory": 0.3, "experiment": 0.3, "timings": 0.3, "shard": 0.3, "survey": 0.3, "collect": 0.4},
    **{"frontier": 0.2, "figure": 0.5, "animation": 1.1, "pdf": 0.4, "table": 0.2},
}
_DRAWING = 1.0  # more than that, of a figure that shows more than a run
_STARTING = 0.12  # of Snakemake, to choose and start a job

# Of an experiment and of a timing: by the axis or problem that its options name, or else by its measure.
_EXPERIMENT = {
    **{"bounce-map": 2.4, "apex-edge": 32.0, "held-contacts": 16.0, "rocking": 1.3, "energy-budget": 0.8},
    **{"failure-map": 1.0, "friction-chatter": 0.8, "precision-limits": 1.2},
    **{"model-ablation": 5.0, "work-precision": 33.0, "engine-contact": 2.0, "engine-limits": 2.6, "engine-throw": 6.5},
    **{"pair-limits": 28.0, "pair-outcomes": 35.0, "pair-orders": 8.0},
    **{"granular-steps": 3.0, "granular-impacts": 0.1, "granular-beads": 0.2},
    **{"landing": 20.0, "coarse-steps": 200.0},
    **{"stiffness": 1.0, "damping": 12.5, "friction": 1.0, "mass": 11.5, "radius": 31.0, "spin": 21.5, "start": 1.0},
    **{"box-faces": 120.0, "face-response": 170.0, "launch-response": 130.0, "response-checks": 170.0},
    **{"flat-bounce": 25.0, "sliding-bounce": 21.0, "tumbling-throw": 75.0},
    **{"pair-peers": 1.0},
    **{"toss": 0.1, "toss-fit": 95.0, "toss-models": 3.5, "toss-steps": 92.0, "toss-chaos": 34.0},
}
_TIMING = {
    **{"work-precision": 3.0, "model-ablation": 1.2, "engine-speed": 3.2},
    **{"flat-bounce": 24.0, "sliding-bounce": 17.0, "tumbling-throw": 34.0},
}

# Of these for so many throws: more take longer by as much.
_THROWS, _THROWN = 200_000, ("landing", "coarse-steps")

# A later round has that part of the work by which its shards are counted (`shards`), which is a generous guess.
_LATER = 0.25

# Where nothing is compiled yet, the first job of a kind compiles: of runs and of sweeps for each model, and of all else
# once.
_COMPILING = {"trajectory": 6.0, "shard": 12.0, "experiment": 5.0, "timings": 5.0}

# What takes `_SUM` seconds on the machine of `cost`: that many numbers added, each waiting for the one before.
_NUMBERS, _SUM = np.ones(4096), 1.27e-5
_LOOK = 0.01


class Job(NamedTuple):
    """What is known of how long the job of a result takes [s].

    kind: as of `kind_of`; jobs of one kind take as long as their weights say. took: the job, when it last ended well,
    if it is known. due: whether it is still to be made. log: of a running one.
    """

    kind: str
    weight: float
    took: float | None
    due: bool
    log: Told | None = None


def left(jobs: Sequence[Job], cores: int, pace: float) -> float:
    """Return about how long [s] the jobs that are due take; `cores` of them at a time, timings one by one.

    A job takes as long as its progress says, the more the farther it is, as it may have compiled first; else as it took
    before; one that never ended, as the median of its kind. Of a kind of which none ended, as all that have; where none
    has, `pace` [s] for each of its weight.
    """
    known = []
    for kind, weight, took, due, log in jobs:
        elapsed, whole = 0.0, took
        if log and log.begun:
            elapsed = (datetime.now(UTC) - log.begun).total_seconds()
            if log.progress:
                past, early = (log.written - log.begun).total_seconds(), (1.0 - log.progress) ** 4
                whole = (1.0 - early) * past / log.progress + early * (past + (1.0 - log.progress) * weight * pace)
        known.append((kind, weight, whole, due, elapsed))
    ended = [(kind, whole / weight) for kind, weight, whole, _, _ in known if whole is not None]
    pace = median(rate for _, rate in ended) if ended else pace
    rates = {kind: median(rate for other, rate in ended if other == kind) for kind in dict(ended)}
    shared, alone = [0.0], [0.0]
    for kind, weight, whole, due, elapsed in known:
        if due:
            expected = rates.get(kind, pace) * weight if whole is None else whole
            (alone if kind == "timings" else shared).append(max(0.0, expected - elapsed))
    return max(sum(shared) / cores, *shared) + sum(alone)


def kind_of(study: Study, result: Result) -> str:
    """Return of what kind the job of a result is: its stage, of which sweep a shard is, what an experiment measures."""
    match result.stage:
        case "shard":
            return f"shard {result.name.partition('/')[0]}"
        case "experiment":
            return f"experiment {study.experiments[result.name].measure}"
    return result.stage


def seconds(study: Study) -> dict[Result, float]:
    """Return how long the job of each result of a study takes [s], on a core of the machine that `cost` is of."""
    found, compiled = dict[Result, float](), set[tuple[str, ...]]()
    cold = not any(cache_folder().glob("*._march-*.nbc"))  # without a loop of runs
    for result in outputs.of(study):
        work, kinds = _work(study, result)
        found[result] = _JOB[result.stage] + _STARTING + work
        if cold:
            found[result] += _COMPILING.get(result.stage, 0.0) * len(kinds - compiled)
            compiled |= kinds
    return found


def _work(study: Study, result: Result) -> tuple[float, set[tuple[str, ...]]]:
    """Return the seconds of a job beyond its start, and the kinds of compiled code that it needs."""
    name, _, part = result.name.partition("." if result.stage == "trajectory" else "/")
    match result.stage:
        case "trajectory":
            return 0.0, {("run", study.runs[name].model)}
        case "shard":
            sweep = study.sweeps[name]
            plan = shards.of(sweep)[part]
            return plan.seconds * (_LATER if plan.round else 1.0), {(sweep.model,)}
        case "experiment" | "timings":
            timed = result.stage == "timings"
            asked, table = (study.timings[name], _TIMING) if timed else (study.experiments[name], _EXPERIMENT)
            choice = asked.options.get("axis", asked.options.get("problem"))
            throws = asked.options.get("throws") if asked.measure in _THROWN else None
            more = throws / _THROWS if isinstance(throws, int) and throws > 0 else 1.0  # else the experiment will say
            return table.get(str(choice), table.get(asked.measure, 0.0)) * more, {(result.stage, name)}
        case "figure" if DRAWINGS[study.figures[name].draw].given != "runs":
            return _DRAWING, set()
    return 0.0, set()


def slowness() -> float:
    """Return how many times as long as the machine that `cost` is of this one takes; looks for a hundredth of a second.

    The best of some thousand tries, which other work on the machine does not change.
    """
    begun, best = time.perf_counter(), float("inf")
    while (start := time.perf_counter()) - begun < _LOOK:
        np.add.accumulate(_NUMBERS)
        best = min(best, time.perf_counter() - start)
    return best / _SUM


def crowding(cores: int) -> float:
    """Return how many times as long as alone jobs on so many cores take beside what else runs on this machine now."""
    try:
        load, _, _, tasks, *_ = Path("/proc/loadavg").read_text(encoding="ascii").split()
        # The mean of a minute knows of what has just ended; a moment may be an odd one.
        others = min(float(load), int(tasks.partition("/")[0]) - 1)
    except (OSError, ValueError):
        return 1.0
    return max(1.0, (others + cores) / max(cores, os.cpu_count() or 1))
