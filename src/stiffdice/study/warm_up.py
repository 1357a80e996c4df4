"""Shortest runs that load, or compile, the kernels that the jobs of a study need."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from stiffdice.dynamics.kernel_cache import NotStoredError, only_stored
from stiffdice.errors import StiffdiceError
from stiffdice.scene import scene as scenes
from stiffdice.simulation import energy_budget
from stiffdice.simulation.backend import OURS
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.reference_run import references
from stiffdice.simulation.run import simulate
from stiffdice.study.config import Study

_MEMBERS = 4  # of a cell: so many go side by side
_DURATION = 1e-6  # s: in which no cube that is thrown reaches the ground


def load_kernels(study: Study, root: Path = Path(), *, compiling: bool = False) -> Iterator[None]:
    """Load what is stored, and compile the rest or, by default, nothing; yields between two runs of one step.

    root: where the scenes are.
    """
    seen = set()
    loading = nullcontext if compiling else only_stored
    for planned in study.runs.values():
        kernels = (planned.model, planned.scheme)
        if planned.simulator == OURS and kernels not in seen:
            seen.add(kernels)
            scene = scenes.load(root / planned.scene, preset=planned.presets[0])
            with _whatever_fails(), loading():
                run = simulate(scene, model=planned.model, scheme=planned.scheme, steps=1, every=1)
                if planned.scheme in energy_budget.BOOKED:
                    energy_budget.ledger(scene, model=run.model, scheme=planned.scheme, steps=1)
            yield
    for sweep in study.sweeps.values():
        if sweep.simulator == OURS:
            scene, criteria = replace(sweep.scene, duration=_DURATION), sweep.criteria
            with _whatever_fails(), loading():
                launches = turned(scene, sweep.model, _MEMBERS)
                compared = references(scene, sweep.model, launches[:1], 1e-3)[0] if "trajectory" in criteria else None
                members = phased(scene, sweep.model, 1, _MEMBERS, launches, slice(0, _MEMBERS))
                asked: dict[str, Any] = {"criteria": criteria, "stop": criteria, "references": compared}
                simulate(scene, model=sweep.model, scheme=sweep.scheme, steps=1, members=members, **asked)
            yield


def _whatever_fails() -> AbstractContextManager[None]:
    """End the block where it may not compile; and where the scene is such that its jobs fail, which they tell."""
    return suppress(NotStoredError, StiffdiceError)
