"""The ground of the paper, section 2.2: a plane through the origin that pushes back on every node."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from stiffdice.errors import InputError
from stiffdice.scene import validation


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


@dataclass(frozen=True)
class Ground:
    """An elastic plane; all constants are per node.

    stiffness S [kg/s²], damping D [kg/s], friction coefficient mu [1], contact: the contact law.
    normal: the direction out of the ground; any length but zero, stored with length one.
    Raises InputError for values out of range.
    """

    stiffness: float = 1.0e4
    damping: float = 0.2
    friction: float = 0.075
    contact: str = "ungated"
    normal: validation.Vector = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        for key, unit in (("stiffness", "kg/s²"), ("damping", "kg/s"), ("friction", "1")):
            value = validation.number(f"ground.{key}", getattr(self, key), unit, at_least=0)
            object.__setattr__(self, key, value)
        validation.choice("ground.contact", self.contact, CONTACT_LAWS)
        normal = validation.vector("ground.normal", self.normal, "1")
        largest = max(abs(part) for part in normal)
        if largest == 0:
            raise InputError("ground.normal = [0, 0, 0]: allowed is any direction but zero (normalised to length 1)")
        object.__setattr__(self, "normal", _unit(normal, largest))


def _unit(normal: validation.Vector, largest: float) -> validation.Vector:
    """Return `normal` with length one, unchanged if it has that to rounding (so that storing is idempotent)."""
    # Scaling by a power of two keeps the squares in range and changes no digit.
    exponent = math.frexp(largest)[1]
    x, y, z = (math.ldexp(part, -exponent) for part in normal)
    length = math.sqrt(x * x + y * y + z * z)
    if abs(math.ldexp(length, exponent) - 1) < 4e-16:
        return normal
    return x / length + 0.0, y / length + 0.0, z / length + 0.0  # as checks.number: no -0
