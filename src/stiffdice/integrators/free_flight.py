"""What schemes share: free flight in closed form, and sums of motions and wrenches, six numbers each."""

from __future__ import annotations

import math
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.models import tumbling
from stiffdice.dynamics.state import Motion, Physics


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
    if models.turns(model):
        tumbling.turn(physics, state, time)


@njit
def landing(pull: Any, clearance: float, speed: float) -> float:
    """Return when [s] a point at a clearance [m], not negative, and a speed [m/s] upwards meets the ground; inf: never.

    pull [m/s²]: its acceleration towards the ground.
    """
    square = speed * speed + 2 * pull * clearance
    if speed < 0.0:
        return 2 * clearance / (math.sqrt(square) - speed) if square >= 0.0 else math.inf
    return (speed + math.sqrt(square)) / pull if pull > 0.0 else math.inf


@njit
def scaled(a: Any, factor: float) -> Motion:
    """Return factor·a."""
    return factor * a[0], factor * a[1], factor * a[2], factor * a[3], factor * a[4], factor * a[5]


@njit
def plus(a: Motion, b: Motion, factor: float) -> Motion:
    """Return a + factor·b."""
    c = scaled(b, factor)
    return a[0] + c[0], a[1] + c[1], a[2] + c[2], a[3] + c[3], a[4] + c[4], a[5] + c[5]
