"""`restitution`: each bounce gives back what the contact law, solved exactly, gives back.

For flat landings only, four nodes at once: there the law is known exactly (`flat_bounce.py`). A bounce counts if the
cube fell from at least ten times its sag at rest; below, it is settling, and its weight matters as much as the blow.
"""

from __future__ import annotations

import math
from typing import Any

from stiffdice.dynamics import flat_bounce
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import room_of
from stiffdice.simulation.monitor import settled
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.task import System

MEASURE = "restitution_error"
LONG_NAME = "largest difference of a bounce's restitution from the contact law's, over the flat landings"
MEANING = "each flat bounce's e within tolerance of the exact one of its contact law"
BASE, TOLERANCE = 0.0, 0.05
FAILURE = Verdict.RESTITUTION_OFF
BY_DEFAULT, FOR_TURNING = False, False
SLOTS = 1  # the measure


@njit
def observe(slots: Any, sight: Any, system: System, state: Any, reference: Any) -> tuple[float, bool]:
    """Return the measure so far, and whether nothing can change it any more; not-a-number after any other landing."""
    physics = system.physics
    blow = sight.speed_in * sight.speed_in / 2
    if sight.lifted > 0.0 and blow > 0.0 and blow >= settled(sight) and sight.pull >= 0.0 and physics.stiffness > 0.0:
        free = room_of(physics, state)
        # An undamped cube goes deepest: its sag twice, and v/ω.
        depth = 2 * sight.sag + sight.speed_in * math.sqrt(physics.mass / 4 / physics.stiffness)
        if depth < free and not math.isnan(slots[0]):
            out = flat_bounce.rebound_speed(physics, sight.pull, sight.speed_in)
            slots[0] = max(slots[0], abs(sight.speed_out - out) / sight.speed_in)
        else:
            slots[0] = math.nan
    return slots[0], sight.held > 0.0
