"""A run from any launch, in steps of one size, by any method: a scheme of ours, or an outside engine, all alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, States, physics_of
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import fixed_step
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.engines.adapter import Engine
from stiffdice.simulation.engines.registry import ENGINES, PEERS


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
    return ENGINES[method].own_steps if method in ENGINES else method in schemes.OWN_STEPS


def lag(method: str) -> float:
    """Return by how many steps a method's velocity is behind the place, as `registry.LAGS`."""
    return engines.adapter_of(method).LAG if method in ENGINES else schemes.LAGS[method]


def unfit(method: str, scene: Scene, model: str) -> str | None:
    """Return in one sentence why a method cannot represent a scene and model, or None if it can."""
    if method in ENGINES:
        return engines.adapter_of(method).unfit(scene, model)
    return schemes.unfit(method, scene, model)


def start(
    method: str, scene: Scene, model: str, launch: States, h: float, tolerance: float = schemes.TOLERANCE
) -> Engine:
    """Return a run from a launch, shape (1,), in steps of h [s]; tolerance [1]: for one that controls its error."""
    if method in ENGINES:
        return engines.adapter_of(method)(scene, model, launch, h, tolerance)
    return _Scheme(scene, model, launch, h, tolerance, scheme=method)


def ready(
    method: str, scene: Scene, model: str, launch: States, steps: int, samples: int
) -> Callable[[], Callable[[], int]]:
    """Return a function that starts a run of the scene's duration, and returns another that makes it.

    Only the second is to be timed: it keeps a state after each of so many equal parts of the duration, and returns the
    force evaluations that it took.
    """
    every, h = steps // samples, scene.duration / steps

    def launched() -> Callable[[], int]:
        engine, states = start(method, scene, model, launch, h), np.zeros(samples, STATE)
        return lambda: engine.advance(states, every)

    return launched


@dataclass(eq=False)
class _Scheme(Engine):
    """One run of a scheme, standing where the last step left it."""

    scheme: str = ""

    def __post_init__(self) -> None:
        self._tags = schemes.SCHEMES[self.scheme], MODELS[self.model], LAWS[self.scene.ground.contact]
        self._physics, self._state = physics_of(self.scene), self.launch.copy()

    def advance(self, states: States, every: int) -> int:
        """Fill `states`, shape (K,), with the state after each `every` further steps; return the force evaluations."""
        whole = np.concatenate([self._state, states])
        evaluations = fixed_step.advance(*self._tags, self._physics, whole, every, self.h, self.tolerance)
        states[:], self._state = whole[1:], whole[-1:]
        return int(evaluations)
