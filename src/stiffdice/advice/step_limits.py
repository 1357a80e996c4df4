"""How long a step may be on a ground, by scheme and by what it is to keep.

The linear limit is theory's (`linear_stability`), of the fastest contact of a cube that turns. No theory knows the rest
for a damped contact: flat bounces are measured, without gravity, with longer and longer steps, each met by the ground
at several phases of a step. A limit is the longest of these steps up to which none failed: as contact switches on and
off, longer ones may pass again (docs/explanation/stability.md).
"""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from stiffdice.advice.contact_design import Contact
from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import STATE, Array, start_of
from stiffdice.errors import InputError
from stiffdice.integrators import linear_stability
from stiffdice.integrators import registry as schemes
from stiffdice.scene import flat_landing
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.simulation.engines import registry as engines

MODEL = "vertical"
FIXED = tuple(name for name in schemes.SCHEMES if name not in ("exact", "event"))

# What is kept, and by how much: energy, which may grow by so much of what the cube comes with; restitution, over the
# exact one; the path until the next landing, in radii of the cube.
CRITERIA = {"energy": 0.05, "restitution_5": 0.05, "restitution_1": 0.01, "path": 0.01}

# Steps are tried from the least ωh on, by this factor, up to the last; besides those half way between magic steps.
LEAST, _FACTOR, MOST = 1e-4, 10 ** (1 / 12), 4.0
_MAGIC = 32
PHASES = 12

# Of the restitution [1], below which a cube leaves the ground ever more slowly; and of the depth v/ω in sides, below
# which round-off in the height is seen in the phases.
_RESTITUTION, _DEPTH = 1e-3, 1e-8

# A bounce is followed for so many times what it should take, and for some steps more.
_PATIENCE, _MORE = 1.3, 8


class Limits(NamedTuple):
    """The longest steps of a scheme.

    linear [s]: by theory, infinite without a limit, 0 where every step is unstable. kept [s]: by CRITERIA; infinite
    where no step tried failed, 0 where all did.
    """

    linear: float
    kept: dict[str, float]


class Bounces(NamedTuple):
    """Flat bounces by phase, shape (phase,): restitution [1], not-a-number of a cube that stays; and how far the centre
    is off the exact path until it next lands, at the most [m].
    """

    restitution: Array
    off: Array


def check(contact: Contact) -> None:
    """Raise InputError for a contact whose bounces cannot be measured."""
    if contact.restitution < _RESTITUTION:
        raise InputError(
            f"restitution = {contact.restitution:.3g}: allowed where steps are measured is {_RESTITUTION:g} or more"
        )
    if contact.speed / contact.omega < _DEPTH * contact.scene.cube.side:
        raise InputError(
            f"depth = {contact.depth:.3g} m: allowed where steps are measured is {_DEPTH:g} of the side or more"
        )


def limits(contact: Contact, scheme: str) -> Limits:
    """Return the longest steps of a scheme of fixed steps on a ground; raises InputError as `check` does."""
    check(contact)
    hardest = linear_stability.hardest(contact.scene, "tumbling")
    linear = linear_stability.stability_limit(scheme, hardest.zeta) / hardest.omega
    kept = dict.fromkeys(CRITERIA, math.inf)
    longest = 0.0
    for omega_h in _ladder():
        h = omega_h / contact.omega
        broken = _broken(contact, bounces(contact, scheme, h))
        for name in broken:
            kept[name] = min(kept[name], longest)
        if all(value < math.inf for value in kept.values()):
            break
        longest = h
    return Limits(linear, kept)


def _ladder() -> list[float]:
    """Return values of ωh, ascending."""
    count = math.floor(math.log(MOST / LEAST) / math.log(_FACTOR)) + 1
    between = [linear_theory.magic_step(n + 0.5) for n in range(1, _MAGIC)]
    return sorted([*(LEAST * _FACTOR**k for k in range(count)), *between])


def _broken(contact: Contact, found: Bounces) -> list[str]:
    """Return the criteria that these bounces do not keep."""
    exact = contact.restitution
    with np.errstate(invalid="ignore"):
        off = np.abs(found.restitution / exact - 1)
        kept = {
            "energy": not (found.restitution**2 > 1 + CRITERIA["energy"]).any(),
            "restitution_5": (off <= CRITERIA["restitution_5"]).all(),
            "restitution_1": (off <= CRITERIA["restitution_1"]).all(),
            "path": (found.off <= CRITERIA["path"] * contact.scene.cube.radius).all(),
        }
    return [name for name, holds in kept.items() if not holds]


def bounces(contact: Contact, method: str, h: float, phases: int = PHASES) -> Bounces:
    """Return flat bounces without gravity in steps of h [s], which meet the ground at so many phases of a step.

    method: a scheme, or an engine that is installed.
    """
    scene, speed, zeta = dataclasses.replace(contact.scene, gravity=0.0), contact.speed, contact.zeta
    phase = np.arange(phases) / phases
    height = speed * h * (1 + phase)
    # From touch-down on: at the end of the contact the cube is where springs balance dashpots, 2ζ/ω e v deep.
    exact_time = (flat_landing.duration(contact.law, zeta) + 2 * zeta) / contact.omega
    steps = math.ceil(_PATIENCE * exact_time / h) + _MORE
    launches = np.repeat(start_of(scene, MODEL), phases)
    launches["position"][:, 2] = scene.cube.side / 2 + height
    # Dashpots that act in mid-air take so much of the speed on the way to the ground.
    drag = 8 * scene.ground.damping / scene.cube.mass if CONTACT_LAWS[contact.law].onset < 0 else 0.0
    launches["velocity"][:, 2] = -(speed + drag * height)
    end, engine = np.zeros(phases, STATE), engines.adapter_of(method)
    for k in range(phases):
        engine(scene, MODEL, launches[k : k + 1], h).advance(end[k : k + 1], steps)
    with np.errstate(all="ignore"):  # a bounce that blows up
        low, upward = end["position"][:, 2] - scene.cube.side / 2, end["velocity"][:, 2]
        restitution = np.where((low > 0) & (upward > 0), upward / speed, np.nan)
        exact = contact.restitution * speed
        now = low - exact * (h * steps - h * (1 + phase) - exact_time)
        flight = 2 * exact / contact.scene.gravity if contact.scene.gravity > 0 else 0.0
        later = now + (upward - exact) * flight
    return Bounces(restitution, np.where(np.isnan(restitution), np.inf, np.maximum(np.abs(now), np.abs(later))))
