"""A run from any launch, in steps of one size, by any method: a scheme of ours, or an outside peer, all alike."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, States, physics_of, start_of
from stiffdice.errors import InputError
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import fixed_step
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.engines.adapter import Engine
from stiffdice.simulation.engines.registry import ENGINES, PEERS


class Path(NamedTuple):
    """What came of a run: states at the launch and after equal parts of the duration, evaluations of the force.

    states: shape (sample + 1,); NaN where the run failed. computed: evaluations that were made; the others were taken
    at once.
    """

    states: States
    evaluations: int
    computed: int


def dearness(method: str) -> float:
    """Return about how many steps of our simplest scheme take as long as one of a method's."""
    return PEERS[method].dearness if method in PEERS else 1.0


def chosen_from(names: Sequence[str], allowed: Sequence[str] = (*schemes.SCHEMES, *ENGINES)) -> list[str]:
    """Return these methods; raises InputError for one that is not allowed, or not installed."""
    for name in names:
        if validation.choice("methods", name, allowed) in PEERS:
            engines.adapter_of(name, "methods")
    return list(names)


def attributes(methods: Sequence[str]) -> dict[str, str]:
    """Return the attribute that says of which versions the engines and solvers among methods are."""
    found = dict.fromkeys(engines.adapter_of(name, "methods").version() for name in methods if name in PEERS)
    return {"engine_versions": "; ".join(found)} if found else {}


def own_steps(method: str) -> bool:
    """Return whether a method takes steps of its own between two states."""
    return PEERS[method].own_steps if method in PEERS else method in schemes.OWN_STEPS


def lag(method: str) -> float:
    """Return by how many steps a method's velocity is behind the place, as `registry.LAGS`."""
    return engines.adapter_of(method).LAG if method in PEERS else schemes.LAGS[method]


def unfit(method: str, scene: Scene, model: str) -> str | None:
    """Return in one sentence why a method cannot represent a scene and model, or None if it can."""
    if method in PEERS:
        return engines.adapter_of(method).unfit(scene, model)
    return schemes.unfit(method, scene, model)


def start(
    method: str,
    scene: Scene,
    model: str,
    launch: States,
    h: float,
    tolerance: float = schemes.TOLERANCE,
    most: int | None = schemes.BUDGET,
) -> Engine:
    """Return a run from a launch, shape (1,), in steps of h [s]; tolerance [1], most: see `Engine`."""
    if method in PEERS:
        return engines.adapter_of(method, "method")(scene, model, launch, h, tolerance, most)
    return _Scheme(scene, model, launch, h, tolerance, most, scheme=method)


def ready(
    method: str, scene: Scene, model: str, steps: int, samples: int, tolerance: float = math.nan
) -> Callable[[], Callable[[], Path]]:
    """Return a function that starts a run of the scene's duration, and returns another that makes it.

    Only the second is to be timed. steps: a multiple of `samples`; `samples` of them for a method that takes its own.
    samples: equal parts of the duration, after each of which the state is kept. tolerance [1]: relative, as the method
    understands it; not-a-number where it looks at none. Raises InputError for an unknown method or model, a scene that
    it cannot represent, where it is not installed, and for other steps.
    """
    validation.choice("method", method, (*schemes.SCHEMES, *PEERS))
    validation.choice("model", model, MODELS)
    samples, steps = validation.count("samples", samples), validation.count("steps", steps)
    if steps % samples:
        raise InputError(f"steps = {steps}: allowed is a multiple of samples = {samples}")
    if method in PEERS:
        engines.check_fit(method, scene, model, "method")
    launch, wanted = start_of(scene, model), schemes.TOLERANCE if math.isnan(tolerance) else tolerance

    def started() -> Callable[[], Path]:
        states = np.zeros(samples + 1, STATE)
        states[:1] = launch
        run = start(method, scene, model, launch, scene.duration / steps, wanted, None)

        def made() -> Path:
            evaluations = run.advance(states[1:], steps // samples)
            return Path(states, evaluations, evaluations)

        return made

    return started


@dataclass(eq=False)
class _Scheme(Engine):
    """One run of a scheme, standing where the last step left it."""

    scheme: str = ""

    def __post_init__(self) -> None:
        self._tags = schemes.SCHEMES[self.scheme], MODELS[self.model]
        self._physics, self._state = physics_of(self.scene), self.launch.copy()

    def advance(self, states: States, every: int) -> int:
        """Fill `states`, shape (K,), with the state after each `every` further steps; return the force evaluations."""
        whole = np.concatenate([self._state, states])
        evaluations = fixed_step.advance(*self._tags, self._physics, whole, every, self.h, self.tolerance)
        states[:], self._state = whole[1:], whole[-1:]
        return int(evaluations)
