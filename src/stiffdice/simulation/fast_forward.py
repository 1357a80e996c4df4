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
from typing import Any, NamedTuple

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import drags, height_of, lowest_of, reaches, speed_of, swing_square
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Physics
from stiffdice.integrators import registry as schemes

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
def _undisturbed(model: Any, law: Any, speed: float, sight: Any) -> float:
    """Return for how many steps a body in the air at this speed along the normal [m/s] feels nothing.

    Under a law that drags on falling nodes that is as long as all rise, which is known only where none turns.
    """
    if not (drags(law) and models.touches(model)):
        return math.inf
    if models.turns(model) or speed < 0.0:
        return 0.0
    return speed / (sight.step_size * sight.pull) if sight.pull > 0.0 else math.inf


@njit
def may_fly(law: Any, model: Any, sight: Any) -> bool:
    """Return whether a body in the air feels nothing for a while."""
    return _undisturbed(model, law, sight.speed, sight) > 0.0


@njit
def _until(room: Any, speed: Any, pull: Any, h: Any) -> Any:
    """Return after how many steps of h [s] a body at `speed` [m/s] under `pull` [m/s²] has fallen by `room` [m]."""
    if pull > 0.0:
        root = math.sqrt(speed * speed + 2 * pull * room)
        return ((speed + root) / pull if speed > 0.0 else 2 * room / (root - speed)) / h
    if pull < 0.0 or speed >= 0.0:
        return 0.0 if speed < 0.0 else math.inf
    return room / -speed / h


@njit
def free_steps(model: Any, law: Any, physics: Physics, state: Any, sight: Any, most: int) -> int:
    """Return a number of steps, at most `most`, in which no node touches the ground and no force but weight acts.

    It need not be the greatest. Along the ground's normal the path is a parabola, open downwards, so that over any
    number of steps it is lowest at an end.
    """
    if sight.flight < 2.0 or most < WORTHWHILE or lost(sight):
        return 0
    h = sight.step_size
    # A scheme's path may be off the parabola by a step's move or two.
    margin = 4 * h * (abs(sight.speed) + h * abs(sight.pull))
    room = sight.height - models.extent(model, physics, state) - margin
    steps = _until(room, sight.speed - h * sight.pull, sight.pull, h) if room > 0.0 else 0.0
    undisturbed = _undisturbed(model, law, sight.speed, sight)
    steps = min(steps, undisturbed)
    if models.turns(model) and steps < most and undisturbed > steps:
        steps = max(steps, _turning(physics, state, sight, margin))
    return 0 if steps < WORTHWHILE else int(min(steps, float(most)))


@njit
def _turning(physics: Physics, state: Any, sight: Any, margin: float) -> float:
    """Return for how many steps no node of a turning body touches the ground, each on a bound of its own.

    A node at r moves up at n·(u + ω × r), and what turning adds to its acceleration is (n × ω)·(ω × r), at most
    |n × ω| |ω| |r|. So its path stays above a parabola, the closer the shorter it is.
    """
    n, w = (physics.nx, physics.ny, physics.nz), state.angular_momentum
    wx, wy, wz = w[0] / physics.inertia, w[1] / physics.inertia, w[2] / physics.inertia
    ax, ay, az = n[1] * wz - n[2] * wy, n[2] * wx - n[0] * wz, n[0] * wy - n[1] * wx
    bend = math.sqrt((ax * ax + ay * ay + az * az) * (wx * wx + wy * wy + wz * wz)) * physics.reach
    pull, h = sight.pull + bend, sight.step_size
    if not pull > 0.0:
        return 0.0
    soonest = math.inf
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        rx, ry, rz = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        room = sight.height + (n[0] * rx + n[1] * ry + n[2] * rz) - margin
        if not room > 0.0:
            return 0.0
        # n·(ω × r) = (n × ω)·r
        speed = sight.speed - h * pull + (ax * rx + ay * ry + az * rz)
        soonest = min(soonest, _until(room, speed, pull, h))
    return soonest


class Phase(NamedTuple):
    """The acceleration constant − square·c − rate·u, in m, s, and for how long [s] it is certain."""

    square: float
    rate: float
    constant: float
    lasts: float


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
def phase_of(law: Any, physics: Physics, sight: Any, most: float) -> Phase:
    """Return the phase that a flat cube is in, certain for at most `most` [s]; it lasts 0 where it changes now."""
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
        elif u < 0.0 and reaches(law, clearance):
            rate += 4 * damping / physics.mass
    lasts, changes = _bounds(square, rate, constant - square * c - rate * u, u, sight.step_size)
    lasts = min(lasts, most)
    for face in range(2):
        clearance = c + face * sight.room
        lasts = min(lasts, _until_zero(clearance, 1.0, 0.0, u, changes, sight.step_size))
        if clearance < 0.0:
            push = -stiffness * clearance - damping * u
            lasts = min(lasts, _until_zero(push, stiffness, damping, u, changes, sight.step_size))
        elif damping > 0.0 and reaches(law, clearance):
            lasts = min(lasts, _until_zero(u, 0.0, 1.0, u, changes, sight.step_size))
    return Phase(square, rate, constant, lasts)


@njit
def resting_swing(law: Any, physics: Physics, sight: Any) -> float:
    """Return below which √Q [m/s] a flat cube never leaves the ground, but for round-off; negative where not known.

    With y the height above that of rest and ω² = 4S/m, Q = u² + ω²y² − h ω² u y is what symplectic Euler keeps of an
    undamped cube on four nodes, and the swing is below √Q/(ω√(1 − (ωh)²/4)). A further acceleration δ adds hδ(u + u')
    to Q. Damping, and a push that cannot become a pull, act against the speed and so lower it, but in a step that turns
    the cube around: by less than 0.6 rate·h (ωh)² Q there.
    """
    h, omega = sight.step_size, math.sqrt(4 * physics.stiffness / physics.mass)
    damped = h * (8.0 if reaches(law, 1.0) else 4.0) * physics.damping / physics.mass
    if omega * h > 0.5 or damped > 1.0 or not 0.0 < 2 * sight.sag < sight.room:
        return -1.0
    grows = math.exp(0.3 * sight.steps * damped * (omega * h) ** 2)
    return omega * sight.sag * math.sqrt(1 - (omega * h) ** 2 / 4) / grows


@njit
def _rests(law: Any, physics: Physics, sight: Any) -> bool:
    """Return whether a flat cube swings about its rest by less than its sag, so that it never leaves the ground.

    Round-off of the height adds at most ω·ulp in a step to √Q.
    """
    # (ω·sag)² is pull·sag; most steps end here.
    if not sight.clearance < 0.0 or sight.speed * sight.speed > 2 * sight.pull * sight.sag:
        return False
    omega = math.sqrt(4 * physics.stiffness / physics.mass)
    square = swing_square(omega, sight.step_size, sight.clearance + sight.sag, sight.speed)
    lost = sight.steps * omega * 2.0**-52 * abs(sight.height)
    return math.sqrt(square) + lost < resting_swing(law, physics, sight)


@njit
def _hangs(law: Any, physics: Physics, sight: Any) -> bool:
    """Return whether a flat cube that sinks through the air as fast as its drag allows ends before it lands."""
    drag, weight = 8 * physics.damping, physics.mass * sight.pull
    if sight.flight < 2.0 or not -sight.speed * drag > 0.999 * weight > 0.0 or not reaches(law, 1.0):
        return False
    if drag * sight.step_size > physics.mass:
        return False
    left = sight.steps * sight.step_size - (sight.time - sight.late)
    lost = sight.steps * 2.0**-52 * abs(sight.height)
    return max(-sight.speed, weight / drag) * left + lost < sight.clearance


@njit
def rest_of(model: Any, law: Any, physics: Physics, sight: Any) -> float:
    """Return below which `swing_square` [m²/s²] a cube may rest, so that `skip` is asked; −1 where it never does."""
    if models.turns(model) or not sight.room > 0.0 or sight.held > 0.0:
        return -1.0
    swing = resting_swing(law, physics, sight)
    return swing * swing if swing > 0.0 else -1.0


@njit
def _rubs(physics: Physics, state: Any) -> bool:
    """Return whether friction acts on a cube that touches the ground."""
    return physics.friction > 0.0 and (state.velocity[0] != 0.0 or state.velocity[1] != 0.0)


@njit
def follows(scheme: Any, model: Any, physics: Physics, state: Any, sight: Any) -> bool:
    """Return whether this is a motion of which `skip` knows the phases, and takes one as soon as it may."""
    flat = not models.turns(model) and sight.room > 0.0 and physics.nz == 1.0
    return flat and not _rubs(physics, state) and schemes.proven(scheme)


@njit
def skip(scheme: Any, model: Any, law: Any, physics: Physics, state: Any, sight: Any, most: int) -> int:
    """Take all steps but one or two, at most `most`, that are sure to stay within the phase, and return how many.

    Zero where that is too few to be worth it, and where the motion is not known. The next step is in the phase, too.
    """
    if models.turns(model) or not sight.room > 0.0:
        return 0
    rubs = _rubs(physics, state)
    stays = not rubs and sight.still > 0.0
    if schemes.proven(scheme) and not stays:
        stays = _rests(law, physics, sight) or (not rubs and _hangs(law, physics, sight))
    if stays and sight.held == 0.0:
        sight.held = 1.0
        return 0
    followed = follows(scheme, model, physics, state, sight)
    if not followed or sight.flight == 1.0 or most < WORTHWHILE + 2 or lost(sight):
        return 0
    h = sight.step_size
    sight.clearance = sight.height - lowest_of(physics, state)  # far from the ground it was a lower bound
    phase = phase_of(law, physics, sight, most * h)
    steps = int(min(phase.lasts / h, float(most))) - 2
    if steps < WORTHWHILE:
        return 0
    place, speed = sight.clearance, sight.speed
    moved, speed = schemes.swing(scheme, place, speed, h, steps, phase.square, phase.rate, phase.constant)
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
