"""Regularised friction on level ground, where a known normal force slows a cube that slides straight on.

A speed w obeys m w' = −μ N w/(w + cutoff), so that w + cutoff·ln w falls by the loss μP/m, with P = ∫N dt the normal
impulse. In z = ln(w_before/w), which neither underflows nor cancels, that is w_before(1 − exp(−z)) + cutoff·z = loss:
Lambert's function, from full slip, w ≫ cutoff, to a stuck cube, w ≪ cutoff, whose speed falls exponentially and ends as
zero. Of the way only that at a constant force has a closed form; the other is an integral over exp(−z).
"""

from __future__ import annotations

import math
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.integrators.exact.oscillator import Oscillator, response

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
        fine, coarse, first, last = _ways(motion, pull, friction, speed, cutoff, since, since + span)
        halves = speed * last + cutoff < (speed * first + cutoff) / 2
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


@njit
def _ways(
    motion: Oscillator, pull: float, friction: float, speed: float, cutoff: float, low: Any, high: float
) -> tuple[float, float, float, float]:
    """Return the integral of that share from low to high [s] by the rules with 15 and 7 nodes, and the ends' shares."""
    half = (high - low) / 2
    middle = low + half
    fine = coarse = first = share = 0.0
    for k in range(-7, 8):
        node, heavy, light = _KRONROD[abs(k)]
        share = _share(motion, pull, friction, speed, cutoff, middle + (half * node if k > 0 else -half * node))
        fine += heavy * share
        coarse += light * share
        first = share if k == -7 else first
    return half * fine, half * coarse, first, share
