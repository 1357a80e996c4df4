"""What is seen of a run while it goes on: flights, touch-downs and lift-offs, as criteria need them.

Between two steps the cube's speed is not known, and at a step a scheme's velocity may lag behind its place: symplectic
Euler's is that of half a step ago, forward Euler's of half a step ahead (`lag`, in steps). In free flight, where the
acceleration is constant from step to step, the slope of the parabola through the places is u + lag·(u − u_before), and
from it follow the speeds at which the cube meets the ground and leaves it, exactly, between the steps.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import height_of, lowest_of, room_of, speed_of
from stiffdice.dynamics.state import Physics

# Of one run. Constants, set by who makes it: step_size [s], steps (of the whole run), late [s] (how far along the
# scene's flight the launch is), lag [steps], hop_height [m] (lower rebounds are not judged by `apex`); and by `start`:
# pull (gravity towards the ground, along its normal) [m/s²], sag [m] (how deep a cube at rest sinks in, at most its
# side), room [m] (how much higher than the four lowest nodes the others are at the launch; 0 if those are not level).
# Of the last step: time [s] since the scene's launch, clearance of the lowest node [m], speed away from the ground
# [m/s] and the speed one step before; flight: how many steps in a row have been in the air; lifted: 1 if in this step
# a flight after a bounce became known; still: 1 if it changed neither height nor speed; held: 1 if no criterion can
# change any more (`fast_forward.py`); touched: 1 if a node was on the ground at any step so far. Of the last bounce:
# speed_in, speed_out [m/s] at zero clearance, NaN if unknown. Of a scheme that takes its own steps
# (`adaptive_steps.py`): pending [s], what is left of the step that was begun; work, done so far.
SIGHT = np.dtype(
    [
        (name, np.float64)
        for name in (
            *("step_size", "steps", "late", "lag", "hop_height", "pull", "sag", "room"),
            *("time", "height", "clearance", "speed", "speed_before", "flight", "lifted", "still", "held", "touched"),
            *("speed_in", "speed_out", "bounces", "touchdown_phase", "pending", "work"),
        )
    ]
)


@njit
def clearance_of(physics: Physics, state: Any, height: float, speed: float, h: float) -> float:
    """Return the lowest node's height above the ground [m]; a lower bound where it is far from touching."""
    far = height - physics.reach
    # Farther than it can fall in the next step, so that the step in which it touches down starts exact.
    if far > 0.0 and far > 2 * h * (abs(speed) + h * physics.gravity):
        return far
    return height - lowest_of(physics, state)


@njit
def start(sight: Any, physics: Physics, state: Any) -> None:
    """Begin to watch a run that stands at its launch; `sight` is zero but for what who makes it has set."""
    sight.pull = physics.gravity * physics.nz
    if sight.pull > 0.0:
        hardly = physics.mass * sight.pull < 4 * physics.stiffness * physics.side
        sight.sag = physics.mass * sight.pull / 4 / physics.stiffness if hardly else physics.side
    sight.room = room_of(physics, state)
    sight.time = sight.late
    sight.height = height_of(physics, state)
    sight.speed = speed_of(physics, state)
    sight.speed_before = sight.speed + sight.step_size * sight.pull
    sight.clearance = sight.height - lowest_of(physics, state)
    # A launch in the air is amid its flight, not at the start of one.
    sight.flight = 2.0 if sight.clearance > 0.0 else 0.0
    sight.touched = 1.0 if sight.clearance <= 0.0 else 0.0
    sight.speed_in = sight.speed_out = sight.touchdown_phase = math.nan


@njit
def observe(sight: Any, physics: Physics, state: Any, step: int, flown: int) -> None:
    """Look at the state after step number `step`; flown: steps of free flight that went by unseen before."""
    h = sight.step_size
    height = height_of(physics, state)
    speed = speed_of(physics, state)
    clearance = clearance_of(physics, state, height, speed, h)
    before = sight.speed
    if flown > 0:
        sight.flight += flown
        before = speed + h * sight.pull
    sight.lifted = 0.0
    if clearance > 0.0:
        sight.flight += 1.0
        if sight.flight == 2.0:
            sight.bounces += 1.0
            sight.lifted = 1.0
            sight.speed_out = _at_the_ground(sight, speed, before, clearance)
    else:
        if sight.flight > 0.0:
            if math.isnan(sight.touchdown_phase):
                sight.touchdown_phase = sight.clearance / (sight.clearance - clearance)
            if sight.flight > 1.0:
                sight.speed_in = _at_the_ground(sight, sight.speed, sight.speed_before, sight.clearance)
        sight.flight = 0.0
        sight.touched = 1.0
    sight.still = 1.0 if flown == 0 and height == sight.height and speed == sight.speed else 0.0
    sight.time = sight.late + step * h
    sight.height = height
    sight.clearance = clearance
    sight.speed_before = before
    sight.speed = speed


@njit
def _at_the_ground(sight: Any, speed: float, before: float, clearance: float) -> float:
    """Return the speed [m/s] at zero clearance on the parabola through a step in the air and the one before."""
    slope = speed + sight.lag * (speed - before)
    return math.sqrt(max(0.0, slope * slope - 2 * clearance * (speed - before) / sight.step_size))


@njit
def settled(sight: Any) -> float:
    """Return the energy of a fall from ten times the sag, over the mass [J/kg]: below, a bounce is a cube settling."""
    return 10 * sight.pull * sight.sag
