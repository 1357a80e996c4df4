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


@njit
def step(model: Any, law: Any, physics: Physics, state: Any, h: float) -> None:
    """Advance `state` by one step of h [s]."""
    wrench = models.force(model, law, physics, state)
    models.kick(model, physics, state, wrench, h)
    models.drift(model, physics, state, h)
