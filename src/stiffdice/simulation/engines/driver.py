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
from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, Physics, States
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import monitor
from stiffdice.simulation.backend import OURS
from stiffdice.simulation.criteria.registry import observe as criteria_observe
from stiffdice.simulation.criteria.registry import open_of
from stiffdice.simulation.engines import registry as engines

# Steps that an engine makes before anybody looks: few at first, as a run may be decided early, then ever more.
_FIRST, _MOST = 256, 8192


def adapter_of(simulator: str) -> Any:
    """Return the adapter of an engine; raises InputError for one that is not known or not installed."""
    validation.choice("simulator", simulator, (OURS, *engines.ENGINES))
    return engines.adapter_of(simulator)


def check_fit(simulator: str, scene: Scene, model: str) -> None:
    """Raise InputError where an engine cannot represent a scene and model."""
    engines.check_fit(simulator, scene, model)


def own_steps(simulator: str) -> bool:
    """Return whether an engine takes steps of its own between two states."""
    return engines.ENGINES[simulator].own_steps


def march(
    simulator: str,
    scene: Scene,
    model: str,
    physics: Physics,
    ensemble: States,
    watched: Any,
    references: npt.NDArray[np.void],
    steps: int,
    h: float,
    tolerance: float,
    budget: int,
    every: int,
    samples: States,
    progress: Callable[[float], None] | None,
) -> None:
    """Let an engine run every member, one after another, and leave all as `simulate` does with its own steps.

    watched: `run.Watched`. budget: steps, or force evaluations of an engine that takes its own. every: keep every
    K-th state in `samples`; 0 keeps none.
    """
    start, law, tag = adapter_of(simulator).start, LAWS[scene.ground.contact], MODELS[model]
    own = own_steps(simulator)
    count, most = len(ensemble), steps if own else min(steps, budget)
    allowed = {"most": budget} if own else {}
    for m in range(count):
        engine = start(scene, model, ensemble[m : m + 1].copy(), h, tolerance, **allowed)
        asked, chunk, goes_on = 0, _FIRST, True
        while asked < most and goes_on:
            states = np.zeros(min(chunk, most - asked), STATE)
            watched.evaluations[m] += engine.advance(states, 1)
            asked += len(states)
            if own and watched.evaluations[m] >= budget:
                states, goes_on = states[: _known(states)], False
                watched.sight["work"][m] = watched.evaluations[m]
            goes_on &= _look(tag, law, physics, states, ensemble, m, *watched[:4], references, every, samples)
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
