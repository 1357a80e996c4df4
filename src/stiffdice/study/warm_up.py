"""Shortest runs, which load or compile the kernels that the jobs of a study need."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from stiffdice.dynamics.compiling.kernel_cache import NotStoredError, only_stored
from stiffdice.errors import StiffdiceError
from stiffdice.scene import scene as scenes
from stiffdice.simulation import energy_budget
from stiffdice.simulation.backend import OURS
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.reference_run import references
from stiffdice.simulation.run import simulate
from stiffdice.study.config import PlannedRun, Study
from stiffdice.sweep.grid import Sweep

_MEMBERS = 4  # of a cell: so many go side by side
_DURATION = 1e-6  # s: in which no cube that is thrown reaches the ground

ShortRun = Callable[[], None]


def short_runs(study: Study, root: Path = Path()) -> Iterator[ShortRun]:
    """Yield functions that make runs of one step, each with kernels of its own. root: where the scenes are."""
    planned = {(run.model, run.scheme): run for run in study.runs.values() if run.simulator == OURS}
    yield from (partial(_trajectory, run, root) for run in planned.values())
    yield from (partial(_cell, sweep) for sweep in study.sweeps.values() if sweep.simulator == OURS)


def load(run: ShortRun) -> bool:
    """Load the kernels of a run, and compile none; return whether all are stored."""
    try:
        with only_stored():
            compile_kernels(run)
    except NotStoredError:
        return False
    return True


def compile_kernels(run: ShortRun) -> None:
    """Compile the kernels of a run that are not stored; a scene in which its jobs fail, too, they tell."""
    with suppress(StiffdiceError):
        run()


def _trajectory(planned: PlannedRun, root: Path) -> None:
    scene = scenes.load(root / planned.scene, preset=planned.presets[0])
    run = simulate(scene, model=planned.model, scheme=planned.scheme, steps=1, every=1)
    if planned.scheme in energy_budget.BOOKED:
        energy_budget.ledger(scene, model=run.model, scheme=planned.scheme, steps=1)


def _cell(sweep: Sweep) -> None:
    scene, criteria = replace(sweep.scene, duration=_DURATION), sweep.criteria
    launches = turned(scene, sweep.model, _MEMBERS)
    compared = references(scene, sweep.model, launches[:1], 1e-3)[0] if "trajectory" in criteria else None
    members = phased(scene, sweep.model, 1, _MEMBERS, launches, slice(0, _MEMBERS))
    asked: dict[str, Any] = {"criteria": criteria, "stop": criteria, "references": compared}
    simulate(scene, model=sweep.model, scheme=sweep.scheme, steps=1, members=members, **asked)
