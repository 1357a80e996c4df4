"""Steps of two boxes that nothing touches, taken at once."""

from __future__ import annotations

import math
from typing import Any

from stiffdice.dynamics.box_contact.pair_state import PairPhysics
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import height_of, speed_of
from stiffdice.dynamics.inertia import spins_steadily
from stiffdice.dynamics.models import tumbling
from stiffdice.dynamics.state import Physics
from stiffdice.dynamics.vector import dot, minus, vector
from stiffdice.integrators import registry as schemes
from stiffdice.integrators.free_flight import landing

# Fewer steps are taken one by one.
_WORTHWHILE = 8


@njit
def _to_ground(physics: Physics, body: Any, h: float) -> float:
    """Return for how long [s] the sphere around a body stays above the ground."""
    pull, speed = physics.gravity * physics.nz, speed_of(physics, body)
    # A scheme's path may be off the parabola by a step's move or two.
    room = height_of(physics, body) - physics.reach - 4 * h * (abs(speed) + h * abs(pull))
    return landing(pull, room, speed - h * pull) if room > 0.0 else 0.0


@njit
def time_to_meet(physics: PairPhysics, pair: Any) -> float:
    """Return for how long [s] the spheres around two boxes stay apart: falling alike, they pass steadily."""
    away = minus(vector(pair.b.position), vector(pair.a.position))
    parting = minus(vector(pair.b.velocity), vector(pair.a.velocity))
    square, closing = dot(parting, parting), -dot(away, parting)
    room = dot(away, away) - (physics.a.reach + physics.b.reach) ** 2
    if room <= 0.0:
        return 0.0
    under = closing * closing - square * room
    if closing <= 0.0 or under <= 0.0:
        return math.inf
    return room / (closing + math.sqrt(under))


@njit
def fly(scheme: Any, physics: PairPhysics, pair: Any, h: float, most: int) -> int:
    """Take at once at most so many steps in which the boxes touch neither each other nor the ground; return them."""
    if not (spins_steadily(physics.a.body) and spins_steadily(physics.b.body)) or most < _WORTHWHILE:
        return 0
    free = time_to_meet(physics, pair) - 4 * h
    if free <= _WORTHWHILE * h:
        return 0
    free = min(free, _to_ground(physics.a, pair.a, h), _to_ground(physics.b, pair.b, h))
    if not free > _WORTHWHILE * h:
        return 0
    steps = int(min(free / h, float(most)))
    schemes.flight(scheme, tumbling.TAG, physics.a, pair.a, h, steps)
    schemes.flight(scheme, tumbling.TAG, physics.b, pair.b, h, steps)
    pair.depth = 0.0
    return steps
