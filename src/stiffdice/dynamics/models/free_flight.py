"""`flying`: the weight alone. For a cube that nothing touches; it turns at the spin of its launch."""

from __future__ import annotations

from collections import namedtuple
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import Wrench
from stiffdice.dynamics.models import sliding, tumbling
from stiffdice.dynamics.state import Physics

Flying = namedtuple("Flying", ())
TAG = Flying()

kick = sliding.kick  # no torque ever changes the spin
drift = tumbling.drift


@njit
def force(physics: Physics, state: Any) -> Wrench:
    """Return the weight [N]: there is no ground."""
    return 0.0, 0.0, -physics.weight, 0.0, 0.0, 0.0
