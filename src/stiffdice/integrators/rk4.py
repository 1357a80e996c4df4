"""The classical Runge-Kutta scheme of order four, its rotations by the method of Munthe-Kaas.

Place and momenta: Kutta 1901; Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, II.1. The
orientation is exp(θ) times that at the step's begin, so that the cube stays rigid, with
θ' = ω − θ × ω/2 + θ × (θ × ω)/12, what order four needs of dexp⁻¹ (Munthe-Kaas 1999, Appl. Numer. Math. 29, 115;
Iserles, Munthe-Kaas, Nørsett and Zanna 2000, Acta Numerica 9, 215). A free flight is exact. An undamped oscillator is
stable for ωh < 2√2 and loses (ωh)⁶/72 of its energy in a small step (Hairer and Wanner, II, IV.2).
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

import numpy as np

from stiffdice.dynamics.box_contact.pair_state import PAIR, PairPhysics
from stiffdice.dynamics.compilation import by_tag, njit
from stiffdice.dynamics.contact import Wrench
from stiffdice.dynamics.inertia import spin_of
from stiffdice.dynamics.models import pair, tumbling
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import STATE, Motion, Physics
from stiffdice.dynamics.vector import Vector, assign, cross, times, vector
from stiffdice.integrators.free_flight import plus, scaled

RK4 = namedtuple("RK4", ())
TAG = RK4()
FORMULA = "classical Runge-Kutta of order 4 for x, u and L; nodes turned by Munthe-Kaas' method of the same order"
LAG = 0.0  # the velocity is the path's slope at the place
OF_PAIRS = True

# How far from the step's begin each stage is, in steps, and its weight in the mean of all.
_STAGES = ((0.0, 1 / 6), (0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6))
_NONE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@njit
def _step_of_one(model: Any, physics: Physics, state: Any, h: float) -> None:
    begin = np.empty(1, STATE)
    begin[0] = state
    force = motion = mean_force = mean_motion = _NONE
    for far, weight in _STAGES:
        if far > 0.0:
            _advance(model, physics, begin[0], state, motion, force, far * h)
        force, motion = models.force(model, physics, state), _motion(model, physics, state, motion, far * h)
        mean_force, mean_motion = plus(mean_force, force, weight), plus(mean_motion, motion, weight)
    _advance(model, physics, begin[0], state, mean_motion, mean_force, h)


@njit
def _step_of_two(model: Any, physics: PairPhysics, state: Any, h: float) -> None:
    begin = np.empty(1, PAIR)
    begin[0] = state
    force_a = force_b = motion_a = motion_b = _NONE
    mean_force_a = mean_force_b = mean_motion_a = mean_motion_b = _NONE
    for far, weight in _STAGES:
        if far > 0.0:
            _advance(tumbling.TAG, physics.a, begin[0].a, state.a, motion_a, force_a, far * h)
            _advance(tumbling.TAG, physics.b, begin[0].b, state.b, motion_b, force_b, far * h)
        force_a, force_b = models.force(model, physics, state)
        motion_a = _motion(tumbling.TAG, physics.a, state.a, motion_a, far * h)
        motion_b = _motion(tumbling.TAG, physics.b, state.b, motion_b, far * h)
        mean_force_a, mean_force_b = plus(mean_force_a, force_a, weight), plus(mean_force_b, force_b, weight)
        mean_motion_a, mean_motion_b = plus(mean_motion_a, motion_a, weight), plus(mean_motion_b, motion_b, weight)
    _advance(tumbling.TAG, physics.a, begin[0].a, state.a, mean_motion_a, mean_force_a, h)
    _advance(tumbling.TAG, physics.b, begin[0].b, state.b, mean_motion_b, mean_force_b, h)


# (model, model, physics, state, h): take a step.
_step = by_tag({**{type(tag): _step_of_one for tag in models.MODELS.values()}, type(pair.TAG): _step_of_two})


@njit
def step(model: Any, physics: Any, state: Any, h: float, tolerance: float) -> int:
    """Advance `state` by one step of h [s] and return how often the force was evaluated."""
    _step(model, model, physics, state, h)
    return len(_STAGES)


@njit
def _advance(model: Any, physics: Physics, start: Any, state: Any, motion: Motion, force: Wrench, h: float) -> None:
    """Put `state` where these slopes lead in h [s] from the step's begin."""
    assign(state.position, start.position)
    assign(state.velocity, start.velocity)
    assign(state.angular_momentum, start.angular_momentum)
    for k in range(len(start.node_offset)):
        assign(state.node_offset[k], start.node_offset[k])
    models.move(model, state, scaled(motion, h))
    models.kick(model, physics, state, force, h)


@njit
def _motion(model: Any, physics: Physics, state: Any, taken: Motion, h: float) -> Motion:
    """Return the slopes of place and rotation vector, h [s] of `taken` from the step's begin."""
    ux, uy, uz = vector(state.velocity)
    wx = wy = wz = 0.0
    if models.turns(model):
        wx, wy, wz = spin_of(physics.body, physics, state, vector(state.angular_momentum))
    turned = times(h, vector(taken[3:]))
    a = cross(turned, Vector(wx, wy, wz))
    b = cross(turned, a)
    return ux, uy, uz, wx - a.x / 2 + b.x / 12, wy - a.y / 2 + b.y / 12, wz - a.z / 2 + b.z / 12
