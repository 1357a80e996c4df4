"""Many steps at once, where a scheme's closed form is certain to hold for all of them.

In free flight: as many steps as no node can touch the ground in. And in the phases of a flat cube that slides without
friction. Such a cube moves along the ground's normal like a point: no torque turns it, nothing couples it to its
sliding. Its lower and its upper face push with S d − D u, with the damping alone (`ungated`, falling), or not at all;
which, changes from phase to phase. Within one the acceleration is constant − square·c − rate·u, with c the lower face's
clearance and u its speed, and a scheme takes as many steps at once as are sure to stay in it.

A cube is `held` once no criterion can change any more: it rests on the ground without the energy to leave it, or hangs
in the air until the end, or a step changed neither its height nor its speed by a single bit, so that no other will.
"""

from __future__ import annotations

import math
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import drags, height_of, lowest_of, normal_of, reaches, speed_of, swing_square
from stiffdice.dynamics.inertia import spins_steadily
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Physics
from stiffdice.dynamics.vector import Vector, cross, dot, row, vector
from stiffdice.integrators import registry as schemes
from stiffdice.integrators.free_flight import landing
from stiffdice.simulation.task import Member, System

# Fewer than this are stepped: looking ahead costs about as much.
WORTHWHILE = 8

# In units in the last place of the height: a step that moves the cube by less is taken, because stepping loses part of
# it to round-off, half a unit at most, and the same again in the next step.
_LOST = 1024


@njit
def lost(sight: Any) -> bool:
    """Return whether steps are so short that round-off shows in the distance they go."""
    return sight.step_size * abs(sight.speed) < _LOST * 2.0**-52 * abs(sight.height)


@njit
def undisturbed(system: System, sight: Any) -> float:
    """Return for how many steps a body in the air feels nothing.

    Under a law that drags on falling nodes that is as long as all rise, which is known only where none turns.
    """
    if not (drags(system.physics) and models.touches(system.model)):
        return math.inf
    if models.turns(system.model) or sight.speed < 0.0:
        return 0.0
    return float(sight.speed / (sight.step_size * sight.pull)) if sight.pull > 0.0 else math.inf


@njit
def compared(member: Member, most: int) -> int:
    """Return how many of `most` steps may go by unseen: a reference is looked at as often as it is known."""
    sight, reference = member.sight, member.reference
    return min(most, 1 + int(reference.spacing / sight.step_size)) if reference.horizon >= sight.time else most


@njit
def fly(scheme: Any, system: System, member: Member, most: int) -> int:
    """Take at once steps, at most `most`, in which no node touches the ground and no force but weight acts.

    Return how many; it need not be all. Along the ground's normal the path is a parabola, open downwards, so that over
    any number of steps it is lowest at an end.
    """
    state, sight = member.state, member.sight
    h, model, physics = sight.step_size, system.model, system.physics
    if sight.flight < 2.0 or most < WORTHWHILE or lost(sight):
        return 0
    if models.turns(model) and not spins_steadily(physics.body):
        return 0
    # A scheme's path may be off the parabola by a step's move or two.
    margin = 4 * h * (abs(sight.speed) + h * abs(sight.pull))
    room = sight.height - models.extent(model, physics, state) - margin
    steps = landing(sight.pull, room, sight.speed - h * sight.pull) / h if room > 0.0 else 0.0
    unforced = undisturbed(system, sight)
    steps = min(steps, unforced)
    if models.turns(model) and steps < most and unforced > steps:
        steps = max(steps, _turning(physics, state, sight, margin))
    if steps < WORTHWHILE:
        return 0
    flown = int(min(steps, float(most)))
    schemes.flight(scheme, model, physics, state, h, flown)
    return flown


@njit
def _turning(physics: Physics, state: Any, sight: Any, margin: float) -> float:
    """Return for how many steps no node of a turning body touches the ground, each on a bound of its own.

    A node at r moves up at n·(u + ω × r), and what turning adds to its acceleration is (n × ω)·(ω × r), at most
    |n × ω| |ω| |r|. So its path stays above a parabola, the closer the shorter it is.
    """
    n, momentum = normal_of(physics), vector(state.angular_momentum)
    w = Vector(momentum.x / physics.inertia, momentum.y / physics.inertia, momentum.z / physics.inertia)
    across = cross(n, w)
    bend = math.sqrt(dot(across, across) * dot(w, w)) * physics.reach
    pull, h = sight.pull + bend, sight.step_size
    if not pull > 0.0:
        return 0.0
    soonest = math.inf
    for k in range(len(state.node_offset)):
        node = row(state.node_offset, k)
        room = sight.height + dot(n, node) - margin
        if not room > 0.0:
            return 0.0
        # n·(ω × r) = (n × ω)·r
        soonest = min(soonest, landing(pull, room, sight.speed - h * pull + dot(across, node)) / h)
    return soonest


@njit
def _bounds(square: Any, rate: float, pace: float, speed: float, h: float) -> tuple[float, float]:
    """Return for how long [s] the acceleration stays below which bound [m/s²]; it is `pace` now.

    From a_(n+1) = a_n − square·h·u_(n+1) − rate·h·a_n and |u| ≤ |speed| + bound·time. No time at all where steps are
    too long for the motion.
    """
    omega = math.sqrt(square)
    if omega * h > 0.25 or rate * h > 0.99:
        return 0.0, math.inf
    if square == 0.0:
        return math.inf, abs(pace)
    if rate >= omega:
        return rate / (2 * square), 2 * abs(pace) + 2 * square / rate * abs(speed)
    return 0.25 / omega, 1.5 * abs(pace) + 0.4 * omega * abs(speed)


@njit
def _until_zero(value: Any, by_place: float, by_speed: float, speed: float, changes: float, h: float) -> float:
    """Return for how long [s] value + by_place·c + by_speed·u is sure to keep its sign, the speed changing at most so.

    changes: bound of the acceleration [m/s²]. In n steps c changes by at most nh|speed| + changes·h² n(n + 1)/2.
    """
    first = by_place * (abs(speed) + changes * h) + by_speed * changes
    root = math.sqrt(first * first + 2 * by_place * changes * abs(value))
    return 2 * abs(value) / (first + root) if first + root > 0.0 else math.inf


@njit
def phase_of(system: System, sight: Any, most: float) -> tuple[float, float, float, float]:
    """Return square, rate and constant [m, s] of the phase that a flat cube is in, and for how long [s] it is certain.

    That is for at most `most` [s]; 0 where it changes now.
    """
    physics = system.physics
    stiffness, damping = physics.stiffness, physics.damping
    c, u = sight.clearance, sight.speed
    square, rate, constant = 0.0, 0.0, -sight.pull
    for face in range(2):
        clearance = c + face * sight.room
        if clearance < 0.0:
            if -stiffness * clearance - damping * u > 0.0:
                square += 4 * stiffness / physics.mass
                rate += 4 * damping / physics.mass
                constant -= 4 * stiffness / physics.mass * (face * sight.room)
        elif u < 0.0 and reaches(physics, clearance):
            rate += 4 * damping / physics.mass
    lasts, changes = _bounds(square, rate, constant - square * c - rate * u, u, sight.step_size)
    lasts = min(lasts, most)
    for face in range(2):
        clearance = c + face * sight.room
        lasts = min(lasts, _until_zero(clearance, 1.0, 0.0, u, changes, sight.step_size))
        if clearance < 0.0:
            push = -stiffness * clearance - damping * u
            lasts = min(lasts, _until_zero(push, stiffness, damping, u, changes, sight.step_size))
        elif damping > 0.0 and reaches(physics, clearance):
            lasts = min(lasts, _until_zero(u, 0.0, 1.0, u, changes, sight.step_size))
    return square, rate, constant, lasts


@njit
def resting_swing(system: System, sight: Any) -> float:
    """Return below which √Q [m/s] a flat cube never leaves the ground, but for round-off; negative where not known.

    With y the height above that of rest and ω² = 4S/m, Q = u² + ω²y² − h ω² u y is what symplectic Euler keeps of an
    undamped cube on four nodes, and the swing is below √Q/(ω√(1 − (ωh)²/4)). A further acceleration δ adds hδ(u + u')
    to Q. Damping, and a push that cannot become a pull, act against the speed and so lower it, but in a step that turns
    the cube around: by less than 0.6 rate·h (ωh)² Q there.
    """
    physics = system.physics
    h, omega = sight.step_size, math.sqrt(4 * physics.stiffness / physics.mass)
    damped = h * (8.0 if drags(system.physics) else 4.0) * physics.damping / physics.mass
    if omega * h > 0.5 or damped > 1.0 or not 0.0 < 2 * sight.sag < sight.room:
        return -1.0
    grows = math.exp(0.3 * sight.steps * damped * (omega * h) ** 2)
    return omega * sight.sag * math.sqrt(1 - (omega * h) ** 2 / 4) / grows


@njit
def _stays(system: System, sight: Any, rubs: bool) -> bool:
    """Return whether a flat cube swings about its rest by less than its sag, so that it never leaves the ground.

    Or, without friction, sinks through the air as fast as its drag allows, and ends before it lands. Round-off of the
    height adds at most ω·ulp in a step to √Q.
    """
    physics, h = system.physics, sight.step_size
    drag, weight, ulp = 8 * physics.damping, physics.mass * sight.pull, 2.0**-52 * abs(sight.height)
    if sight.clearance < 0.0:
        if sight.speed * sight.speed > 2 * sight.pull * sight.sag:  # (ω·sag)² is pull·sag; most steps end here
            return False
        omega = math.sqrt(4 * physics.stiffness / physics.mass)
        square = swing_square(omega, h, sight.clearance + sight.sag, sight.speed)
        return math.sqrt(square) + sight.steps * omega * ulp < resting_swing(system, sight)
    if rubs or sight.flight < 2.0 or not -sight.speed * drag > 0.999 * weight > 0.0:
        return False
    if not drags(system.physics) or drag * h > physics.mass:
        return False
    left = sight.steps * h - (sight.time - sight.late)
    return max(-sight.speed, weight / drag) * left + sight.steps * ulp < sight.clearance


@njit
def rest_of(system: System, sight: Any) -> float:
    """Return below which `swing_square` [m²/s²] a cube may rest, so that `skip` is asked; −1 where it never does."""
    if models.turns(system.model) or not sight.room > 0.0 or sight.held > 0.0:
        return -1.0
    swing = resting_swing(system, sight)
    return swing * swing if swing > 0.0 else -1.0


@njit
def _rubs(physics: Physics, state: Any) -> bool:
    """Return whether friction acts on a cube that touches the ground."""
    return physics.friction > 0.0 and (state.velocity[0] != 0.0 or state.velocity[1] != 0.0)


@njit
def follows(scheme: Any, system: System, member: Member) -> bool:
    """Return whether this is a motion of which `skip` knows the phases, and takes one as soon as it may."""
    flat = not models.turns(system.model) and member.sight.room > 0.0 and system.physics.nz == 1.0
    return flat and not _rubs(system.physics, member.state) and schemes.proven(scheme)


@njit
def skip(scheme: Any, system: System, member: Member, most: int) -> int:
    """Take all steps but one or two, at most `most`, that are sure to stay within the phase, and return how many.

    Zero where that is too few to be worth it, and where the motion is not known. The next step is in the phase, too.
    """
    state, sight, physics = member.state, member.sight, system.physics
    if models.turns(system.model) or not sight.room > 0.0:
        return 0
    rubs = _rubs(physics, state)
    still = not rubs and sight.still > 0.0
    if sight.held == 0.0 and (still or (schemes.proven(scheme) and _stays(system, sight, rubs))):
        sight.held = 1.0
        return 0
    if not follows(scheme, system, member) or sight.flight == 1.0 or most < WORTHWHILE + 2 or lost(sight):
        return 0
    h = sight.step_size
    sight.clearance = sight.height - lowest_of(physics, state)  # far from the ground it was a lower bound
    square, rate, constant, lasts = phase_of(system, sight, most * h)
    steps = int(min(lasts / h, float(most))) - 2
    if steps < WORTHWHILE:
        return 0
    moved, speed = schemes.swing(scheme, sight.clearance, sight.speed, h, steps, square, rate, constant)
    if not math.isfinite(moved):
        return 0
    state.position[0] += steps * h * state.velocity[0]
    state.position[1] += steps * h * state.velocity[1]
    state.position[2] += moved
    state.velocity[2] = speed
    if sight.clearance > 0.0:
        sight.flight += steps
    sight.clearance += moved
    sight.height = height_of(physics, state)
    sight.speed = speed_of(physics, state)
    return steps
