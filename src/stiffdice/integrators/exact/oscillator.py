"""The two motions of a piece: along the ground's normal, and of a cube that slides straight on, along the ground.

The first is a damped oscillator under a constant push in closed form: z'' + 2βz' + ω²z = push, from z = 0 at a speed.

With s the response to a unit of speed, q its integral and s' its derivative, z = speed·s + push·q and
z' = speed·s' + push·s (any textbook; s = exp(−βt) sin(ω_d t)/ω_d below critical damping). They are written here so that
each is good to some units in its last place: for all times, on all sides of the critical damping, and without a spring
(ω = 0), damping (β = 0) or both, the parabola.

The second is slowed by regularised friction on level ground. A speed w obeys m w' = −μ N w/(w + cutoff), so that
w + cutoff·ln w falls by the loss μP/m, with P = ∫N dt the normal impulse. In z = ln(w_before/w), which neither
underflows nor cancels, that is w_before(1 − exp(−z)) + cutoff·z = loss: Lambert's function, from full slip, w ≫ cutoff,
to a stuck cube, w ≪ cutoff, whose speed falls exponentially and ends as zero. Of the way only that at a constant force
has a closed form; the other is an integral over exp(−z).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stiffdice.dynamics.compilation import njit

# Below this (ω + β)t [1] the power series is short and precise; above it the closed forms lose at most three bits.
_SHORT = 0.5

# Gauss and Kronrod's rules with 7 and 15 nodes on [−1, 1] (QUADPACK's QK15): node and the weights of 15 and of 7, from
# the middle to the right.
_KRONROD = (
    (0.000000000000000000, 0.209482141084727828, 0.417959183673469388),
    (0.207784955007898468, 0.204432940075298892, 0.0),
    (0.405845151377397167, 0.190350578064785410, 0.381830050505118945),
    (0.586087235467691130, 0.169004726639267903, 0.0),
    (0.741531185599394440, 0.140653259715525919, 0.279705391489276668),
    (0.864864423359769073, 0.104790010322250184, 0.0),
    (0.949107912342758525, 0.063092092629978553, 0.129484966168869693),
    (0.991455371120812639, 0.022935322010529225, 0.0),
)

# The two rules may differ by this much of the way: Kronrod's error of a smooth function is then below round-off. Smooth
# is speed + cutoff over spans in which it does not halve.
_APART = 1e-10


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
        turned, damped = omega * t, 2 * beta * t
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


@njit
def slowed(speed: float, cutoff: float, loss: float) -> float:
    """Return z = ln(speed/speed after the loss) [1]; speed, cutoff and loss in m/s."""
    if loss < 0.5 * (speed + cutoff):
        z = -math.log1p(-loss / (speed + cutoff))
    else:
        z = math.log(speed / cutoff) - _lambert(math.log(speed / cutoff) + (speed - loss) / cutoff)
    before = math.inf
    for _ in range(50):
        step = (loss + speed * math.expm1(-z) - cutoff * z) / (speed * math.exp(-z) + cutoff)
        z += step
        # The next step is about the square of this one.
        if abs(step) <= 1e-9 * min(1.0, z) or not abs(step) < before / 2:
            break
        before = abs(step)
    return z


@njit
def _lambert(both: float) -> float:
    """Return x where exp(x) + x is `both`, to a few digits."""
    if both > 2.0:
        x = math.log(both - math.log(both))
    elif both < -2.0:
        x = both - math.exp(both)
    else:
        x = (both - 1) / 2
    for _ in range(2):
        grown = math.exp(x)
        x -= (grown + x - both) / (grown + 1)
    return x


@njit
def evenly(speed: float, cutoff: float, brake: float, t: float) -> tuple[float, float]:
    """Return speed [m/s] and way [m] after t [s] of a constant μN/m, `brake` [m/s²]."""
    if not speed * brake > 0.0:
        return speed, speed * t
    z = slowed(speed, cutoff, brake * t)
    left = speed * math.exp(-z)
    return left, -speed * math.expm1(-z) * ((speed + left) / 2 + cutoff) / brake


@njit
def along(
    motion: Oscillator, pull: float, friction: float, speed: float, cutoff: float, t: float
) -> tuple[float, float]:
    """Return speed [m/s] and way [m] after t [s] while the normal force moves the cube as the oscillator does.

    pull [m/s²]: the part of the oscillator's push that is no force of the ground, but gravity towards it.
    """
    if speed == 0.0 or (motion.omega == 0.0 and motion.beta == 0.0):
        return speed, speed * t
    way, since, span = 0.0, 0.0, t
    while since < t:
        span = min(span, t - since)
        half = ((since + span) - since) / 2
        middle = since + half
        fine = coarse = first = share = 0.0  # the integral by both rules, and the shares of the speed at both ends
        for k in range(-7, 8):
            node, heavy, light = _KRONROD[abs(k)]
            when = middle + (half * node if k > 0 else -half * node)
            share = _share(motion, pull, friction, speed, cutoff, when)
            fine += heavy * share
            coarse += light * share
            first = share if k == -7 else first
        fine, coarse = half * fine, half * coarse
        halves = speed * share + cutoff < (speed * first + cutoff) / 2
        if (halves or abs(fine - coarse) > _APART * (way + fine)) and first * span > 2.0**-60 * (way + fine):
            span /= 2
            continue
        way += fine
        if span == t - since:
            break
        since += span
        span *= 2
    return speed * _share(motion, pull, friction, speed, cutoff, t), speed * way


@njit
def _share(motion: Oscillator, pull: float, friction: float, speed: float, cutoff: float, t: float) -> float:
    """Return what share of the speed is left at time t [s]."""
    s, q, _ = response(motion.omega, motion.beta, t)
    force = motion.push + pull - 2 * motion.beta * motion.speed
    impulse = force * s - motion.omega * motion.omega * motion.speed * q + pull * (t - s)
    return math.exp(-slowed(speed, cutoff, friction * max(0.0, impulse)))
