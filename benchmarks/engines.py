"""Other people's engines on the same throw, one step of 10⁻⁴ s after another, by `stiffdice.simulation.engines`."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.case import Case, Effort, Missing
from benchmarks.scenes import STEP_SIZE, scene_of
from stiffdice.dynamics.state import STATE, start_of
from stiffdice.errors import NotInstalledError
from stiffdice.simulation.engines.adapter import Engine
from stiffdice.simulation.engines.registry import adapter_of

# By adapter: what it is called, most steps of a call (fewer than the 100,000 of the listing are spent in the air, at
# the engine's best), and what holds it back.
ENGINES = {
    "mujoco": ("MuJoCo", 100_000, "a general engine: collisions are looked for and a solver is called every step"),
    "pybullet": ("PyBullet", 20_000, "a general engine, called from Python every step"),
    "drake": ("Drake", 10_000, "a general engine: collisions, a solver and a discrete event every step"),
    "octave": (
        "GNU Octave, all nodes at once",
        4_000,
        "interpreted: some 40 calls a step, each of a microsecond or more",
    ),
    "numpy_loop": ("NumPy loop", 4_000, "interpreted: calls of a microsecond, on arrays of 24 numbers"),
}


def cases(effort: Effort) -> Iterator[Case | Missing]:
    """Yield the throw and its vertical part, gated; an engine that is not installed, or cannot do it, is missing."""
    for name, (title, most, holds) in ENGINES.items():
        try:
            adapter = adapter_of(name.removesuffix("_loop"))
        except NotInstalledError as error:
            yield Missing(name, f"{title}: {str(error).splitlines()[0]}")
            continue
        steps = min(most, effort.steps)
        for model in ("tumbling", "vertical"):
            scene = scene_of("gated", steps)
            why = adapter.unfit(scene, model)
            if why is not None:
                yield Missing(f"{name}_{model}_gated", f"{title}: {why}")
                continue
            yield Case(
                f"{name}_{model}_gated",
                f"{'throw' if model == 'tumbling' else model}, gated: {title}, the first {steps * STEP_SIZE:g} s",
                "step",
                steps,
                lambda adapter=adapter, model=model, steps=steps: _standing(adapter, model, steps),  # type: ignore[misc]
                effort.slow,
                holds,
                version=adapter.version(),
            )


def _standing(adapter: type[Engine], model: str, steps: int) -> Callable[[], int]:
    """Return what takes so many steps with an engine that stands at the launch."""
    scene = scene_of("gated", steps)
    engine = adapter(scene, model, start_of(scene, model), STEP_SIZE)
    states = np.zeros(1, STATE)
    return lambda: int(engine.advance(states, steps))
