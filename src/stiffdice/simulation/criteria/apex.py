"""`apex`: no rebound goes higher than the one before it.

Heights stand for the energy of the motion that bounces: m v²/2 at lift-off, along the ground's normal, so that friction
cannot hide a gain by draining the sliding. The first rebound is measured against what the launch reaches. A flight
counts as at least `hop_height` high, and as ten times the sag of a cube at rest: lower hops are its settling. Without
a height for them, a hop of a millimetre after minutes decides as much as the first rebound, and the number of steps
that passes depends on the duration. A cube that tumbles may rightly bounce higher than before, paid for by its spin.
"""

from __future__ import annotations

from typing import Any

from stiffdice.dynamics import energy
from stiffdice.dynamics.compilation import njit
from stiffdice.scene.scene import Scene
from stiffdice.simulation.monitor import settled
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.task import System

MEASURE = "apex_ratio"
LONG_NAME = "largest apex over the apex before it, heights above touch-down"
MEANING = "no apex above (1 + tolerance) of the one before"
BASE, TOLERANCE = 1.0, 0.02
FAILURE = Verdict.APEX_ROSE
BY_DEFAULT, FOR_TURNING = True, False
SLOTS = 2  # largest ratio so far, energy of the last flight over the mass [J/kg]

# Rebounds lower than this part of the cube's radius are not judged, unless a height is given.
HOP = 0.1


def default_hop_height(scene: Scene) -> float:
    """Return the height [m] below which rebounds are not judged where none is given."""
    return HOP * scene.cube.radius


@njit
def start(slots: Any, sight: Any, system: System, state: Any) -> None:
    """Begin to watch a run that stands at its launch."""
    slots[0] = 0.0
    slope = sight.speed - sight.lag * sight.step_size * sight.pull
    held = energy.elastic(system.physics, state) / system.physics.mass
    slots[1] = slope * slope / 2 + sight.pull * sight.clearance + held


@njit
def observe(slots: Any, sight: Any, system: System, state: Any, reference: Any) -> tuple[float, bool]:
    """Return the measure so far, and whether nothing can change it any more."""
    if sight.lifted > 0.0:
        now = sight.speed_out * sight.speed_out / 2
        before = max(slots[1], settled(sight), sight.pull * sight.hop_height)
        if before > 0.0:
            slots[0] = max(slots[0], now / before)
        slots[1] = now
    return slots[0], sight.held > 0.0
