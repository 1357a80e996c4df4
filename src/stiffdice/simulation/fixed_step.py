"""The bare time loop: step after step, nothing watched, nothing skipped."""

from __future__ import annotations

from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.state import Physics, States
from stiffdice.integrators import registry as schemes


@njit(cache=True)
def advance(scheme: Any, model: Any, physics: Physics, samples: States, every: int, h: float, tolerance: float) -> int:
    """Step from samples[0] on and keep every K-th state in the others; return how often the force was evaluated."""
    evaluations = 0
    for k in range(1, samples.shape[0]):
        samples[k] = samples[k - 1]
        state = samples[k]
        for _ in range(every):
            evaluations += schemes.step(scheme, model, physics, state, h, tolerance)
    return evaluations
