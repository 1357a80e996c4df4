"""A flat landing without gravity: restitution, duration, depth and force, and the ground that has them.

Four nodes touch the ground at once. Along the normal the cube is a damped oscillator, z'' + 2ζω z' + ω² z = 0 with
ω² = 4S/m and ζ = D/√(S m), from z = 0 at speed v inwards, on a ground that cannot pull: contact ends when its force is
zero, not at the surface (Schwager and Pöschel 2007, doi:10.1007/s10035-007-0065-z). With ω_d = ω√(1 − ζ²),

- it turns, z' = 0, when ω_d t = arccos ζ, and from there takes the same time to zero force, z'' = 0: with ζ = cos φ,
  z ∝ exp(−ζωt) sin ω_d t has tan ω_d t = tan φ and tan 2φ. So t = arccos ζ/ω_d for either leg, whose speed, damping
  and time are those of the other run backwards;
- z'² + 2ζω z z' + ω² z² falls as exp(−2ζωt), and is v² at the surface and u² at zero force, so that
  e = u/v = exp(−ζ_in ω t_in − ζ ω t_out), and the cube keeps that speed on its way up to the surface.

The arctangents of the paper change their branch at ζ = 1/√2; the same angle written as an arccosine does not, and
arcosh ζ/√(ζ² − 1) takes its place above ζ = 1. Under the `ungated` law the four upper nodes are damped, too, as long as
the cube falls: ζ_in = 2ζ.
"""

from __future__ import annotations

import math
from typing import NamedTuple


class ContactLaw(NamedTuple):
    """When a node at a depth d, moving outwards at u, feels the ground's max(0, S max(0, d) − D u).

    onset [m]: the depth beyond which it does. approach_damping [1]: how many times as strong the damping of a flat
    cube, nodes above the ground included, is on the way in as on the way out.
    """

    onset: float
    approach_damping: float


# ungated: the law of the listings, damping and friction act in mid-air, too. gated: that of the paper's section 4.2,
# only a node below the ground feels it.
CONTACT_LAWS = {"ungated": ContactLaw(-math.inf, 2.0), "gated": ContactLaw(0.0, 1.0)}


def leg(zeta: float) -> float:
    """Return how long one leg takes [1/ω], surface to turn or turn to zero force, at a damping ratio ζ >= 0 [1]."""
    if zeta == 1:
        return 1.0
    angle = math.acos(zeta) if zeta < 1 else math.acosh(zeta)
    # Not √|1 − ζ²|: digits are lost near one, and the square may leave the range of doubles.
    return angle / (math.sqrt(abs(1 - zeta)) * math.sqrt(1 + zeta))


def duration(law: str, zeta: float) -> float:
    """Return how long the contact lasts [1/ω], until its force is zero. law: contact law; zeta [1]: on the way out."""
    return leg(CONTACT_LAWS[law].approach_damping * zeta) + leg(zeta)


def loss(law: str, zeta: float) -> float:
    """Return −ln e [1], e speed out over speed in. law: contact law; zeta [1]: damping ratio on the way out."""
    approach = CONTACT_LAWS[law].approach_damping * zeta
    return approach * leg(approach) + zeta * leg(zeta)


def damping_ratio(law: str, restitution: float) -> float:
    """Return the ζ [1] with a restitution in (0, 1], to round-off: −ln e grows with ζ, and is bisected."""
    wanted = -math.log(restitution)
    low, high = 0.0, math.exp(wanted / 2)  # −ln e >= 2 ln 2ζ, and at ζ = 1 it is two at least
    while low < (middle := low + (high - low) / 2) < high:
        low, high = (middle, high) if loss(law, middle) < wanted else (low, middle)
    return high if wanted > 0 else 0.0


def damping(law: str, restitution: float, stiffness: float, mass: float) -> float:
    """Return D [kg/s] per node, of a ground with a restitution [1] and a stiffness [kg/s²], for a cube's mass [kg]."""
    return damping_ratio(law, restitution) * math.sqrt(stiffness) * math.sqrt(mass)


def stiffness(law: str, restitution: float, contact_time: float, mass: float) -> float:
    """Return S [kg/s²] per node, of a ground with a restitution [1] and a contact time [s], for a cube's mass [kg]."""
    omega = duration(law, damping_ratio(law, restitution)) / contact_time
    return mass * omega * omega / 4


def depth(law: str, zeta: float) -> float:
    """Return the deepest penetration [v/ω] of a landing at a speed v, where the cube turns.

    From the invariant above: ω² z² = v² exp(−2ζ_in ω t_in) at z' = 0.
    """
    approach = CONTACT_LAWS[law].approach_damping * zeta
    return math.exp(-approach * leg(approach))


def peak_force(law: str, zeta: float) -> float:
    """Return the largest force of the ground [m v ω], of a cube of mass m that lands at a speed v.

    With ζ = cos φ, z'' ∝ exp(−ζωt) sin(ω_d t − 2φ) and z''' ∝ exp(−ζωt) sin(ω_d t − 3φ): the force is largest at
    ω_d t = 3φ − π, before the turn, and is m v ω exp(−ζωt) there. From ζ = 1/2 on it is so at touch-down, where the
    dashpots alone push with 2ζ m v ω. All of ζ_in.
    """
    approach = CONTACT_LAWS[law].approach_damping * zeta
    if approach >= 0.5:
        return 2 * approach
    angle = 3 * math.acos(approach) - math.pi
    return math.exp(-approach * angle / math.sqrt((1 - approach) * (1 + approach)))


def stiffness_of_depth(law: str, restitution: float, deepest: float, speed: float, mass: float) -> float:
    """Return S [kg/s²] per node, of a ground with a restitution [1] into which a cube goes so deep [m].

    speed [m/s]: of the landing. mass [kg]: the cube's.
    """
    omega = depth(law, damping_ratio(law, restitution)) * speed / deepest
    return mass * omega * omega / 4
