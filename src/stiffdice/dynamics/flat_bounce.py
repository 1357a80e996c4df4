"""The exact restitution of one flat bounce: four nodes touch the ground at once, and the other four never do.

Along the normal the cube is a damped oscillator on a ground that cannot pull (Schwager and Pöschel 2007,
doi:10.1007/s10035-007-0065-z), here under gravity and with a damping on the way in that the contact law chooses.
With ω² = 4S/m and ζ = D/√(S m), time in units of 1/ω and b = g/ω, the clearance z above where the cube would rest
obeys z'' + 2ζ z' + z = 0, with ζ_in for ζ on the way in. It comes in at z = b with speed a, turns, and goes out until
the four nodes' force is zero, at a speed u where z + 2ζu = b; from there on only its weight acts. For either leg

- the time between the turn and the leg's other end, of speed v = a or u, follows from ω_d cot(ω_d T) = ζ − b/v;
- z'² + 2ζ z z' + z² falls as exp(−2ζt), from a² − 2ζ_in a b + b² at touch-down to u² − 2ζ u b + b² at zero force.

Together, u is the root of u² − 2ζ u b + b² = (a² − 2ζ_in a b + b²) exp(−2 ζ_in T_in(a) − 2ζ T(u)). The way from there
to the surface is 2ζu long, so that the cube leaves it with the square of its speed u² − 4ζ u b. Unless this is positive
the ground keeps the cube: should the force come back before the surface is reached, it does so at less than the speed
2ζb that it takes to bring it to zero again, and what is left of the motion lacks the energy to get out.
"""

from __future__ import annotations

import math
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.state import Physics, physics_of
from stiffdice.errors import InputError
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene

DEAD = 1e150  # past this damping ratio squares leave the range of doubles, and next to none of the speed is left


@njit
def rebound_speed(physics: Physics, pull: float, speed_in: float) -> float:
    """Return the speed [m/s] at which a flat cube leaves the ground that it met at `speed_in` [m/s]; 0 if it stays.

    Both speeds are along the normal, at a clearance of zero. pull [m/s²]: of gravity, towards the ground. Where that is
    negative, under a ceiling, the bounce is not solved and the result is NaN.
    """
    if pull < 0.0:
        return math.nan
    if speed_in <= 0.0 or physics.stiffness <= 0.0:
        return 0.0
    # Roots first: a product or quotient may leave the range of doubles where its root does not.
    omega = 2.0 * math.sqrt(physics.stiffness) / math.sqrt(physics.mass)
    zeta = physics.damping / math.sqrt(physics.stiffness) / math.sqrt(physics.mass)
    if zeta == 0.0:
        return speed_in
    if zeta > DEAD:
        return 0.0
    # In units of the larger of the two speeds neither these nor their squares overflow, and the small one is precise.
    ratio = pull / omega / speed_in
    if ratio < 1.0:
        unit, start, weight = speed_in, 1.0, ratio
    else:
        unit, start, weight = pull / omega, 1.0 / ratio, 1.0
    square = _rebound_squared(physics.approach_damping, zeta, start, weight)
    if square <= 0.0:
        return 0.0
    return min(unit * math.sqrt(square), speed_in)


@njit
def _rebound_squared(approach_damping: float, zeta: float, start: float, weight: float) -> float:
    """Return the square of the speed at lift-off, not positive if there is none; start and weight are a and b."""
    zeta_in = approach_damping * zeta
    brake = zeta * weight
    decay_in = 2.0 * zeta_in * _duration(zeta_in, weight, start)
    # At the least u that gets out, 4ζb.
    if _swing(zeta, zeta_in, start, weight, decay_in, 1.0, 4.0 * zeta) <= 8.0 * brake * brake:
        return 0.0
    # Less than comes in. Above the root the iteration falls, with a slope below 1/3.
    u, lower = math.inf, start
    while lower < u:
        u = lower
        lower = brake + math.sqrt(brake * brake + _swing(zeta, zeta_in, start, weight, decay_in, weight, u))
    return lower * (lower - 4.0 * brake)


@njit
def _swing(zeta: Any, zeta_in: float, start: float, weight: float, decay_in: float, pull: float, speed: float) -> float:
    """Return u² − 2ζ u b of a cube that rises to zero force in the time that belongs to pull/speed."""
    decay = decay_in + 2.0 * zeta * _duration(zeta, pull, speed)
    # With b² taken out, which dwarfs the rest where a cube comes in slowly.
    return start * (start - 2.0 * zeta_in * weight) * math.exp(-decay) + weight * weight * math.expm1(-decay)


@njit
def _duration(zeta: Any, pull: float, speed: float) -> float:
    """Return T [1/ω], the time between the turn and the leg's other end; infinite for a cube that never turns."""
    if zeta < 1.0:
        rate = math.sqrt((1.0 - zeta) * (1.0 + zeta))
        return math.atan2(rate * speed, zeta * speed - pull) / rate
    rate = math.sqrt(zeta - 1.0) * math.sqrt(zeta + 1.0)
    slack = speed / (zeta + rate) - pull
    if slack <= 0.0:
        return math.inf
    if rate == 0.0:
        return speed / slack
    return math.log1p(2.0 * rate * speed / slack) / (2.0 * rate)


def restitution(scene: Scene, speed_in: float) -> float:
    """Return e [1], the speed at lift-off over `speed_in` [m/s], of a flat bounce in this scene; 0 if it stays down.

    Raises InputError for a speed that is not positive and for a ground that faces down.
    """
    speed = validation.number("speed_in", speed_in, "m/s", above=0)
    upward = scene.ground.normal[2]
    if upward < 0:
        raise InputError(f"ground.normal[z] = {upward:g}: a bounce is known for a number >= 0")
    return float(_rebound_speed(physics_of(scene), scene.gravity * upward, speed) / speed)


@njit(cache=True)
def _rebound_speed(physics: Physics, pull: float, speed_in: float) -> float:
    return rebound_speed(physics, pull, speed_in)
