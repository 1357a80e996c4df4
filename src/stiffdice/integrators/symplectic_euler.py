"""Symplectic Euler, the paper's scheme: kick with the old place, then drift with the new velocity.

First order. Without damping it keeps an energy that differs from the true one by O(h). Linearly stable for ωh < 2
(Hairer, Lubich and Wanner, Geometric Numerical Integration, I.1.2 and VI.3). The text calls it "modified forward
Euler"; its equation 7 with the new u_cm is what the listings compute.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Physics

SymplecticEuler = namedtuple("SymplecticEuler", ())
TAG = SymplecticEuler()
FORMULA = "u += h a; L += h torque; x += h u; nodes turned by h L/I"
LAG = 0.5  # the velocity of a step is the path's slope half a step before it: x_n = x_(n−1) + h u_n
OF_PAIRS = True


@njit
def step(model: Any, physics: Physics, state: Any, h: float, tolerance: float) -> int:
    """Advance `state` by one step of h [s] and return how often the force was evaluated."""
    wrench = models.force(model, physics, state)
    models.kick(model, physics, state, wrench, h)
    models.drift(model, physics, state, h)
    return 1


@njit
def _slowed(speed: Any, h: float, steps: int, rate: float, constant: float) -> tuple[float, float]:
    """Take so many steps under a constant force and damping: u_n = u_0 + (constant − rate·u_0) h Σ (1 − e)^j."""
    e, n = rate * h, float(steps)
    pace = constant - rate * speed
    if n * e < 0.05:
        # Σ_j Σ_i<j (1 − e)^i by binomials, term by term smaller by ne/k.
        sum_once, sum_twice, term = 0.0, 0.0, n
        for k in range(1, 10):
            sum_once += term
            sum_twice += term * (n + 1) / (k + 1)
            term *= -e * (n - k) / (k + 1)
        return n * h * speed + pace * h * h * sum_twice, speed + pace * h * sum_once
    gone = -math.expm1(n * math.log1p(-e))
    return n * h * speed + pace / rate * h * (n - (1 - e) * gone / e), speed + pace / rate * gone


@njit
def swing(
    place: float, speed: float, h: float, steps: int, square: float, rate: float, constant: float
) -> tuple[float, float]:
    """Take so many steps of a damped oscillator: the n-th power of the linear map of one step, minus one.

    With q = square·h², e = rate·h <= 1 and y the place from equilibrium, a step minus one is N = [[−q, h(1 − e)],
    [−h square, −e]], and its eigenvalues are −μ with μ² − (q + e)μ + q = 0: all of it without differences of large
    numbers. Not-a-number where the two roots are too close to tell apart.
    """
    if square == 0.0:
        return _slowed(speed, h, steps, rate, constant)
    y = place - constant / square
    q, e = square * h * h, rate * h
    both = q + e
    discriminant = both * both - 4 * q
    if abs(discriminant) < 1e-9 * both * both:
        return math.nan, math.nan
    if discriminant > 0.0:
        large = (both + math.sqrt(discriminant)) / 2
        small = q / large
        fast, slow = math.expm1(steps * math.log1p(-large)), math.expm1(steps * math.log1p(-small))
        grown = (slow * large - fast * small) / (large - small)
        mixed = (slow - fast) / (large - small)
    else:
        # |λ|² = 1 − e, and the angle of a step by 4|λ| sin²(θ/2) = q − (1 − |λ|)².
        shrinking = math.log1p(-e) / 2
        lost = -math.expm1(shrinking)
        theta = 2 * math.asin(math.sqrt((q - lost * lost) / (1 - lost)) / 2)
        shrunk, angle = steps * shrinking, steps * theta
        mixed = math.exp(shrunk) * math.sin(angle) / ((1 - lost) * math.sin(theta))
        grown = math.expm1(shrunk) * math.cos(angle) - 2 * math.sin(angle / 2) ** 2 + mixed * both / 2
    moved = grown * y + mixed * (h * (1 - e) * speed - q * y)
    return moved, speed + grown * speed - mixed * (h * square * y + e * speed)
