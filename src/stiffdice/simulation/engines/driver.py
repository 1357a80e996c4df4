"""A run that an outside engine makes, watched step by step as one of our own.

An engine advances by so many steps and tells the state after each; what watches a run and what judges it then looks at
one state after another. So many at a time that memory stays small, however long the run.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.state import STATE, Physics, States
from stiffdice.simulation import monitor
from stiffdice.simulation.criteria.registry import observe as criteria_observe
from stiffdice.simulation.criteria.registry import open_of
from stiffdice.simulation.engines.registry import ENGINES, adapter_of, check_fit
from stiffdice.simulation.task import Task

__all__ = ["ENGINES", "adapter_of", "check_fit", "march"]  # what `backend.py` loads

# Steps that an engine makes before anybody looks: few at first, as a run may be decided early, then ever more.
_FIRST, _MOST = 256, 8192


def march(task: Task, progress: Callable[[float], None] | None) -> None:
    """Let an engine run every member, one after another, and leave all as `simulate` does with its own steps."""
    setup, watched = task.setup, task.watched
    engine_of, own = adapter_of(setup.simulator), ENGINES[setup.simulator].own_steps
    count, most = len(task.ensemble), setup.steps if own else min(setup.steps, task.budget)
    for m in range(count):
        launch = task.launches[m : m + 1]
        engine = engine_of(setup.scene, setup.model, launch, setup.step_size, task.tolerance, task.budget)
        asked, chunk, goes_on = 0, _FIRST, True
        while asked < most and goes_on:
            states = np.zeros(min(chunk, most - asked), STATE)
            watched.evaluations[m] += engine.advance(states, 1)
            asked += len(states)
            if own and watched.evaluations[m] >= task.budget:
                states, goes_on = states[: _known(states)], False
                watched.sight["work"][m] = watched.evaluations[m]
            seen = task.ensemble, m, *watched[:4], task.references, task.every, task.samples
            goes_on &= _look(*task.tags, task.physics, states, *seen)
            chunk = min(_MOST, 2 * chunk)
            if progress is not None:
                progress((m + watched.steps_done[m] / most) / count)


def _known(states: States) -> int:
    """Return before which state a run was ended."""
    ended = ~np.isfinite(states["position"]).all(axis=1)
    return int(ended.argmax()) if ended.any() else len(states)


@njit(cache=True)
def _look(
    model: Any,
    law: Any,
    physics: Physics,
    states: States,
    ensemble: States,
    m: int,
    memory: npt.NDArray[np.void],
    sight: npt.NDArray[np.void],
    steps_done: npt.NDArray[np.int64],
    steps_computed: npt.NDArray[np.int64],
    references: npt.NDArray[np.void],
    every: int,
    samples: States,
) -> bool:
    """Show states to all that watch member m, and return whether it goes on: neither decided nor out of range."""
    seen, remembered, reference = sight[m], memory[m], references[m % references.shape[0]]
    undecided = open_of(remembered)
    for k in range(states.shape[0]):
        step = steps_done[m] + 1
        ensemble[m] = states[k]
        steps_computed[m] = step
        monitor.observe(seen, physics, states[k], step, 0)
        undecided -= criteria_observe(remembered, step, seen, model, law, physics, states[k], reference)
        if remembered.finite[0] > 0.0:
            return False
        steps_done[m] = step
        if every > 0 and step % every == 0:
            samples[step // every] = states[k]
        if undecided <= 0:
            return False
    return True
