"""Closed forms that schemes share, and what stands for those that a scheme has not."""

from __future__ import annotations

import math
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Physics


@njit
def flight(model: Any, physics: Physics, state: Any, h: float, steps: int, lag: float) -> None:
    """Take so many steps of free flight with a scheme whose velocity is `lag` steps behind its place.

    u_n = u_0 + n h a, x_n = x_0 + n h u_0 + h² a n(n + 2 lag)/2: the parabola with the slope u_0 + lag h a at first.
    """
    time = steps * h
    fall = -physics.weight / physics.mass
    state.position[0] += time * state.velocity[0]
    state.position[1] += time * state.velocity[1]
    state.position[2] += time * (state.velocity[2] + fall * ((time + 2 * lag * h) / 2))
    state.velocity[2] += fall * time
    models.turn(model, physics, state, time)


@njit
def swing(
    place: float, speed: float, h: float, steps: int, square: float, rate: float, constant: float
) -> tuple[float, float]:
    """Return not-a-number twice: so many steps of a damped oscillator have no closed form here, and are stepped."""
    return math.nan, math.nan


@njit
def proven() -> bool:
    """Return that what `fast_forward.py` says of a scheme is not proven."""
    return False
