"""`energy`: in the air the cube never has more energy than at its launch, nor on the ground if it never leaves that.

In the air the springs hold nothing, so kinetic energy + m g z is all there is, and neither contact law can add to it.
The velocity is taken at the step's place, so that free flight keeps this energy under any scheme (symplectic Euler
keeps E − m g h w/2 otherwise). What it started with is counted from the cube at rest on the ground: a metre of height
that it can never give back would dilute every gain.

In a bounce the energy of a scheme swings by a part of (ωh)² of it, and comes back; so contact is not looked at, but in
two cases. A cube that was on the ground at its launch is judged by its mechanical energy, with the springs', until it
leaves the ground. It has at least the energy of its motion along the ground, of its spin, and m g z, the velocity as
stored: friction that throws it to and fro from step to step cancels out of the velocity at the place. So has a cube
that is on the ground at the end.
"""

from __future__ import annotations

import math
from typing import Any

from stiffdice.dynamics import energy
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import speed_of
from stiffdice.dynamics.state import Physics
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.task import System

MEASURE = "energy_ratio"
LONG_NAME = "largest energy over that of the launch, in the air or of a cube that never flew"
MEANING = "airborne energy never above (1 + tolerance) of the launch's"
BASE, TOLERANCE = 1.0, 0.05
FAILURE = Verdict.ENERGY_GREW
BY_DEFAULT, FOR_TURNING = True, True
# Largest ratio so far, energy at launch [J], what a gain is measured by [J], 1 as long as it was never in the air.
SLOTS = 4


@njit
def start(slots: Any, sight: Any, system: System, state: Any) -> None:
    """Begin to watch a run that stands at its launch."""
    physics = system.physics
    grounded = sight.clearance <= 0.0
    slots[3] = 1.0 if grounded else 0.0
    slots[1] = _mechanical(sight, system, state) if grounded else _flying(sight, physics, state)
    # On a slope the zero of m g z means nothing: height counts from the ground right below.
    weight = physics.mass * physics.gravity * abs(physics.nz)
    high = weight * (max(0.0, sight.height - physics.side / 2) + sight.sag / 2)
    slots[2] = energy.kinetic(physics, state) + energy.elastic(physics, state) + high
    if slots[2] <= 0.0:
        slots[2] = 1.0
    # Beyond doubles no gain can be measured, and none shall pass.
    slots[0] = 1.0 if math.isfinite(slots[1]) and math.isfinite(slots[2]) else math.nan


@njit
def observe(slots: Any, sight: Any, system: System, state: Any, reference: Any) -> tuple[float, bool]:
    """Return the measure so far, and whether nothing can change it any more."""
    if sight.flight > 0.0:
        slots[3] = 0.0
        _count(slots, _flying(sight, system.physics, state))
    elif slots[3] > 0.0:
        _count(slots, _mechanical(sight, system, state))
        _count(slots, _without_springs(system.physics, state))
    return slots[0], sight.held > 0.0


@njit
def finish(slots: Any, sight: Any, physics: Physics, state: Any) -> None:
    """Count the last state, if it is on the ground, by the part of its energy that no spring swings with."""
    if sight.clearance <= 0.0:
        _count(slots, _without_springs(physics, state))


@njit
def _count(slots: Any, now: float) -> None:
    ratio = 1.0 + (now - slots[1]) / slots[2]
    slots[0] = max(slots[0], ratio)


@njit
def _without_springs(physics: Physics, state: Any) -> float:
    """Return the energy of the motion along the ground and of the spin, and m g z [J]."""
    along = energy.kinetic(physics, state) - 0.5 * physics.mass * speed_of(physics, state) ** 2
    return along + energy.potential(physics, state)


@njit
def _flying(sight: Any, physics: Physics, state: Any) -> float:
    """Return kinetic energy + m g z [J], the velocity taken at the place."""
    behind = sight.lag * sight.step_size * physics.gravity
    moving = physics.mass * behind * (behind / 2 - state.velocity[2])
    return energy.kinetic(physics, state) + moving + energy.potential(physics, state)


@njit
def _mechanical(sight: Any, system: System, state: Any) -> float:
    """Return kinetic energy + m g z + the springs' [J], the velocity taken at the place."""
    physics, behind = system.physics, sight.lag * sight.step_size
    moving = energy.kinetic_at_place(system.model, physics, state, behind)
    return moving + (energy.potential(physics, state) + energy.elastic(physics, state))
