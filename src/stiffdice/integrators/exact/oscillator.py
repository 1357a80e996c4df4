"""A damped oscillator under a constant push in closed form: z'' + 2βz' + ω²z = push, from z = 0 at a given speed.

With s the response to a unit of speed, q its integral and s' its derivative, z = speed·s + push·q and
z' = speed·s' + push·s (any textbook; s = exp(−βt) sin(ω_d t)/ω_d below critical damping). They are written here so that
each is good to some units in its last place: for all times, on all sides of the critical damping, and without a spring
(ω = 0), damping (β = 0) or both, the parabola.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stiffdice.dynamics.compilation import njit

# Below this (ω + β)t [1] the power series is short and precise; above it the closed forms lose at most three bits.
_SHORT = 0.5


class Oscillator(NamedTuple):
    """omega ω and beta β [1/s], push [m/s²], and the speed at the start [m/s]."""

    omega: float
    beta: float
    push: float
    speed: float


@njit
def response(omega: Any, beta: float, t: float) -> tuple[float, float, float]:
    """Return s [s], q [s²] and s' [1] at time t [s]."""
    if (omega + beta) * t < _SHORT:
        return _series(omega * t, 2 * beta * t, t)
    if beta < omega:
        rate = math.sqrt(omega - beta) * math.sqrt(omega + beta)
        left, angle = math.exp(-beta * t), rate * t
        s = left * math.sin(angle) / rate
        q = (-math.expm1(-beta * t) + 2 * left * math.sin(angle / 2) ** 2 - beta * s) / omega / omega
        return s, q, left * math.cos(angle) - beta * s
    rate = math.sqrt(beta - omega) * math.sqrt(beta + omega)
    fast = beta + rate
    slow = omega * (omega / fast)
    s = math.exp(-slow * t) * (-math.expm1(-2 * rate * t) / (2 * rate) if rate > 0.0 else t)
    q = ((-math.expm1(-slow * t) / slow if slow * t > 1e-17 else t) - s) / fast
    return s, q, math.exp(-fast * t) - slow * s


@njit
def _series(turned: Any, damped: float, t: float) -> tuple[float, float, float]:
    """Return the same by the power series; turned and damped are ωt and 2βt."""
    before, term = 0.0, 1.0
    s = slope = 1.0
    q = 0.5
    for k in range(2, 22):
        before, term = term, -(damped * term + turned * turned / (k - 1) * before) / k
        s += term
        q += term / (k + 1)
        slope += k * term
        if abs(term) + abs(before) < 1e-19:
            break
    return s * t, q * t * t, slope


@njit
def after(motion: Oscillator, t: float) -> tuple[float, float]:
    """Return how far it has moved [m] and its speed [m/s] at time t [s]."""
    s, q, slope = response(motion.omega, motion.beta, t)
    return motion.speed * s + motion.push * q, motion.speed * slope + motion.push * s


@njit
def first_zero(omega: Any, beta: float, value: float, slope: float) -> float:
    """Return when [s] a motion without a push that starts at `value` with `slope` is next zero; infinite if never."""
    if value < 0.0:
        value, slope = -value, -slope
    if beta < omega:
        rate = math.sqrt(omega - beta) * math.sqrt(omega + beta)
        return math.atan2(rate * value, -slope - beta * value) / rate if value > 0.0 else math.pi / rate
    rate = math.sqrt(beta - omega) * math.sqrt(beta + omega)
    slack = -slope - (beta + rate) * value
    if not (slack > 0.0 and value > 0.0):
        return math.inf
    return math.log1p(2 * rate * value / slack) / (2 * rate) if rate > 0.0 else value / slack


@njit
def _gap(motion: Oscillator, by_place: float, by_speed: float, value: Any, t: float) -> tuple[float, float]:
    """Return value + by_place·z + by_speed·z' at time t [s], and its slope."""
    moved, speed = after(motion, t)
    pace = motion.push - motion.omega * motion.omega * moved - 2 * motion.beta * speed
    return value + by_place * moved + by_speed * speed, by_place * speed + by_speed * pace


@njit
def passing(
    motion: Oscillator, by_place: float, by_speed: float, value: Any, sign: float, low: float, high: float, guess: float
) -> float:
    """Return when [s] sign·(value + by_place·z + by_speed·z') becomes positive, to round-off.

    Between low and high [s], in which it grows: `low` if it is positive there already, infinite if not even at `high`.
    Newton's method from a guess [s], or a secant if that is out of bounds; bisection where it leaves the bracket or is
    slow.
    """
    at_high = sign * _gap(motion, by_place, by_speed, value, high)[0]
    at_low = sign * _gap(motion, by_place, by_speed, value, low)[0]
    if not at_high > 0.0:
        return math.inf
    if at_low >= 0.0:
        return low
    stride = high - low
    t = guess if low < guess < high else low + stride * (at_low / (at_low - at_high))
    for _ in range(200):
        if not low < t < high:
            t = low + (high - low) / 2
        gap, slope = _gap(motion, by_place, by_speed, value, t)
        gap *= sign
        if gap < 0.0:
            low = t
        else:
            high = t
        step = -gap / (sign * slope)
        if not abs(step) < stride / 2:
            step = low + (high - low) / 2 - t
        stride = abs(step)
        if stride <= 2.0**-52 * t or gap == 0.0:
            break
        t += step
    return t
