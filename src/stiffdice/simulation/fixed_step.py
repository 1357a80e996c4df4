"""The bare time loop: step after step, nothing watched, nothing skipped. What steps cost is measured with it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, Physics, States, physics_of, start_of
from stiffdice.errors import InputError
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene


class Path(NamedTuple):
    """What came of a run: states at the launch and after equal parts of the duration, evaluations of the force.

    states: shape (sample + 1,); NaN where the run failed. computed: evaluations that were made; the others were taken
    at once.
    """

    states: States
    evaluations: int
    computed: int


@njit(cache=True)
def advance(
    scheme: Any, model: Any, law: Any, physics: Physics, samples: States, every: int, h: float, tolerance: float
) -> int:
    """Step from samples[0] on and keep every K-th state in the others; return how often the force was evaluated."""
    evaluations = 0
    for k in range(1, samples.shape[0]):
        samples[k] = samples[k - 1]
        state = samples[k]
        for _ in range(every):
            evaluations += schemes.step(scheme, model, law, physics, state, h, tolerance)
    return evaluations


def prepare(
    scene: Scene, model: str, scheme: str, samples: int, steps: int, tolerance: float = schemes.TOLERANCE
) -> Callable[[], Path]:
    """Return a function that makes the run in so many steps, from the launch, every time it is called.

    samples: equal parts of the duration, after each of which the state is kept. tolerance [1]: for a scheme that
    controls its own error. Raises InputError for an unknown name, and for steps that are no multiple of `samples`.
    """
    validation.choice("model", model, MODELS)
    validation.choice("scheme", scheme, schemes.SCHEMES)
    samples, steps = validation.count("samples", samples), validation.count("steps", steps)
    if steps % samples:
        raise InputError(f"steps = {steps}: allowed is a multiple of samples = {samples}")
    tags = schemes.SCHEMES[scheme], MODELS[model], LAWS[scene.ground.contact]
    physics, launch = physics_of(scene), start_of(scene, model)
    every, h = steps // samples, scene.duration / steps

    def run() -> Path:
        states = np.empty(samples + 1, STATE)
        states[0] = launch[0]
        evaluations = int(advance(*tags, physics, states, every, h, tolerance))
        return Path(states, evaluations, evaluations)

    return run
