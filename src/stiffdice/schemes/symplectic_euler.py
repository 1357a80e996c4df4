"""Symplectic Euler, the paper's scheme: kick with the old place, then drift with the new velocity.

First order. Without damping it keeps an energy that differs from the true one by O(h). Linearly stable for ωh < 2
(Hairer, Lubich and Wanner, Geometric Numerical Integration, I.1.2 and VI.3). The text calls it "modified forward
Euler"; its equation 7 with the new u_cm is what the listings compute.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from stiffdice import models
from stiffdice.compiled import njit
from stiffdice.state import Physics


class SymplecticEuler(NamedTuple):
    """The tag of this scheme."""


TAG = SymplecticEuler()

# The velocity of a step is the path's slope half a step before it: x_n = x_(n−1) + h u_n.
LAG = 0.5


@njit
def step(model: Any, law: Any, physics: Physics, state: Any, h: float) -> None:
    """Advance `state` by one step of h [s]."""
    wrench = models.force(model, law, physics, state)
    models.kick(model, physics, state, wrench, h)
    models.drift(model, physics, state, h)


@njit
def flight(model: Any, physics: Physics, state: Any, h: float, steps: int) -> None:
    """Take so many steps of free flight: u_n = u_0 + n h a, x_n = x_0 + n h u_0 + h² a n(n + 1)/2."""
    time = steps * h
    fall = -physics.weight / physics.mass
    state.position[0] += time * state.velocity[0]
    state.position[1] += time * state.velocity[1]
    state.position[2] += time * (state.velocity[2] + fall * ((time + h) / 2))
    state.velocity[2] += fall * time
    models.turn(model, physics, state, time)
