"""Velocity Verlet: half a kick, a drift, and half a kick with the force at the new place.

The ground's force depends on velocity, too, which the classical scheme does not foresee. As is usual in dissipative
particle dynamics, the new velocity is predicted by the old force, u + h F/m, the force is evaluated there, and half of
the kick is corrected by it (Groot and Warren 1997, J. Chem. Phys. 107, 4423, with λ = 1: with their λ = 1/2, or with
the velocity at the half step, the order is one). So it is of second order with damping and friction; without either it
is the classical scheme, symplectic and linearly stable for ωh < 2 (Hairer, Lubich and Wanner, Geometric Numerical
Integration, I.1.4). The next step cannot take over the last force: it is at the predicted velocity.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Physics

VelocityVerlet = namedtuple("VelocityVerlet", ())
TAG = VelocityVerlet()
FORMULA = (
    "u += h a/2; L += h torque/2; x += h u; nodes turned by h L/I; u += h a/2; L += h torque/2, predicted and "
    "corrected once"
)
LAG = 0.0  # the velocity is the path's slope at the place: x_(n+1) = x_n + h u_n + h² a/2
OF_PAIRS = True


@njit
def step(model: Any, physics: Physics, state: Any, h: float, tolerance: float) -> int:
    """Advance `state` by one step of h [s] and return how often the force was evaluated."""
    old = models.force(model, physics, state)
    models.kick(model, physics, state, old, h / 2)
    models.drift(model, physics, state, h)
    models.kick(model, physics, state, old, h / 2)
    new = models.force(model, physics, state)
    models.kick(model, physics, state, models.change(model, new, old), h / 2)
    return 2
