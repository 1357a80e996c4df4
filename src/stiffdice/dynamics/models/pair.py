"""`pair`: two rigid boxes that meet each other and the ground, each with translation and rotation.

The paper's section 7 leaves open how two cubes react when they meet. Each moves as in `tumbling.py`; between them acts
what `box_contact` says.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any, NamedTuple

from stiffdice.dynamics import contact
from stiffdice.dynamics.box_contact import law
from stiffdice.dynamics.box_contact.pair_state import PairPhysics
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import Wrench, falling, height_of, reaches, together
from stiffdice.dynamics.models import tumbling
from stiffdice.dynamics.state import Physics

Pair = namedtuple("Pair", ())
TAG = Pair()


class Wrenches(NamedTuple):
    """Force [N] and torque about its centre of mass [N m] on either body."""

    a: Wrench
    b: Wrench


@njit
def _of_ground(physics: Physics, state: Any) -> Wrench:
    if reaches(physics, height_of(physics, state) - physics.reach):
        return tumbling.force(physics, state)
    return falling(physics)


@njit
def force(physics: PairPhysics, state: Any) -> Wrenches:
    """Return force and torque of ground, weight and contact on either body."""
    a, b = law.contact_wrenches(physics, state)
    return Wrenches(together(a, _of_ground(physics.a, state.a)), together(b, _of_ground(physics.b, state.b)))


@njit
def kick(physics: PairPhysics, state: Any, wrench: Wrenches, h: float) -> None:
    """Advance the momenta of both by h [s]."""
    tumbling.kick(physics.a, state.a, wrench.a, h)
    tumbling.kick(physics.b, state.b, wrench.b, h)


@njit
def drift(physics: PairPhysics, state: Any, h: float) -> None:
    """Advance place and orientation of both by h [s]."""
    tumbling.drift(physics.a, state.a, h)
    tumbling.drift(physics.b, state.b, h)


@njit
def change(new: Wrenches, old: Wrenches) -> Wrenches:
    """Return by how much the wrenches have changed."""
    return Wrenches(contact.change(new.a, old.a), contact.change(new.b, old.b))
