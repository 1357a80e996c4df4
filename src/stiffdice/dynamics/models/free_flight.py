"""`flying`: the weight alone. For a cube that nothing touches; it turns at the spin of its launch."""

from __future__ import annotations

from collections import namedtuple

from stiffdice.dynamics.models import sliding, tumbling

Flying = namedtuple("Flying", ())
TAG = Flying()

force = sliding.force  # never asked for: no ground acts on it
kick = sliding.kick  # no torque ever changes the spin
drift = tumbling.drift
