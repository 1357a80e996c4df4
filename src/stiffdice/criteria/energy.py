"""`energy`: in the air the cube never has more energy than at its launch.

In the air the springs hold nothing, so kinetic energy + m g z is all there is, and neither contact law can add to it.
The velocity is taken at the step's place, so that free flight keeps this energy under any scheme (symplectic Euler
keeps E − m g h w/2 otherwise). What it started with is counted from the cube at rest on the ground: a metre of height
that it can never give back would dilute every gain.
"""

from __future__ import annotations

from typing import Any

from stiffdice import energy
from stiffdice.compiled import njit
from stiffdice.state import Physics
from stiffdice.verdict import Verdict

MEASURE = "energy_ratio"
LONG_NAME = "largest airborne energy over the energy at launch, both above that of rest"
MEANING = "airborne energy never above (1 + tolerance) of the launch's"
BASE, TOLERANCE = 1.0, 0.05
FAILURE = Verdict.ENERGY_GREW
BY_DEFAULT, FOR_TURNING = True, True
SLOTS = 3  # largest ratio so far, energy at launch [J], what a gain is measured by [J]


# Of the energies: as much as a flight of many steps may add by it, and far below any gain that matters.
_ROUND_OFF = 1e-12


@njit
def start(slots: Any, sight: Any, physics: Physics, state: Any) -> None:
    """Begin to watch a run that stands at its launch."""
    elastic = energy.elastic(physics, state)
    slots[1] = _flying(sight, physics, state) + elastic
    # On a slope the zero of m g z means nothing: height counts from the ground right below.
    weight = physics.mass * physics.gravity * abs(physics.nz)
    high = weight * (max(0.0, sight.height - physics.side / 2) + sight.sag / 2)
    slots[2] = energy.kinetic(physics, state) + elastic + high
    if slots[2] <= 0.0:
        slots[2] = 1.0
    slots[0] = 1.0 if sight.clearance > 0.0 else 0.0


@njit
def observe(slots: Any, sight: Any, law: Any, physics: Physics, state: Any, reference: Any) -> tuple[float, bool]:
    """Return the measure so far, and whether nothing can change it any more."""
    if sight.flight > 0.0:
        slots[0] = max(slots[0], 1.0 + (_flying(sight, physics, state) - slots[1]) / slots[2])
    return slots[0], sight.held > 0.0


@njit
def ceiling(slots: Any) -> float:
    """Return up to which energy in the air [J] the measure stays what it is, to round-off."""
    return slots[1] + (slots[0] - 1.0) * slots[2] + _ROUND_OFF * (abs(slots[1]) + slots[2])


@njit
def _flying(sight: Any, physics: Physics, state: Any) -> float:
    """Return kinetic energy + m g z [J], the velocity taken at the place."""
    behind = sight.lag * sight.step_size * physics.gravity
    moving = physics.mass * behind * (behind / 2 - state.velocity[2])
    return energy.kinetic(physics, state) + moving + energy.potential(physics, state)
