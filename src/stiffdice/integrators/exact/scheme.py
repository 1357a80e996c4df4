"""The exact motion of a cube that does not turn, piece by piece, in closed form.

All nodes move with the centre, so that along the ground's normal the cube is a point on up to eight springs that begin
at up to eight levels. Which of them press, and which nodes the `ungated` law drags, changes only where

- a falling node meets the ground (touch), or the cube turns, falling or rising;
- a rising node's force S d − D u falls to zero, at which it lets go, or rises above it again.

Between two such events the cube is a damped oscillator, a body in drag, or in free flight (`oscillator.py`). Each is a
zero of a function known in closed form, and so are the zeros of its derivative: between these it is monotone, and the
first event is bracketed, never stepped over. Friction on level ground follows from the normal impulse
(`regularised_friction.py`).

Swings about the rest that never leave the ground are taken at once: each cycle loses the same share of the amplitude,
as the forces are then homogeneous in place and speed. What is left of a swing below the round-off of the place is rest.

A step of any length is exact, to round-off and what the motion makes of that. A stored place is off by half a unit in
the last place, which deep in a contact is as much as ω times that in the speed: long steps are more precise.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any, NamedTuple

import numpy as np

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import drags, height_of, normal_of, split
from stiffdice.dynamics.state import TURNING, Array, Physics
from stiffdice.dynamics.vector import vector
from stiffdice.integrators.exact.levels import BELOW, HEIGHT, SUM, fill
from stiffdice.integrators.exact.oscillator import Oscillator, after, first_zero, passing
from stiffdice.integrators.exact.regularised_friction import along, evenly
from stiffdice.integrators.free_flight import flight, landing
from stiffdice.scene.scene import Scene

Exact = namedtuple("Exact", ())
TAG = Exact()
FORMULA = "parabolas and damped oscillations in closed form, from one event to the next"
LAG = 0.0  # the velocity is that at the stored place

# A cube that stands still, and is as near to touching the ground in units of its height, touches it.
_LAID = 2.0**-51
# A cube whose acceleration is as much less than the forces that cancel in it is at rest.
_STILL = 2.0**-50
# Cycles of a cube that slides are taken at once if that changes less of the way.
_UNSEEN = 1e-15

# What changes at the end of a piece.
_NONE, _TOUCH, _PRESS, _RELEASE = range(4)


class _Ground(NamedTuple):
    """frequency √(S/m) and decay D/2m of one node [1/s]; drags: whether nodes in the air are damped; pull [m/s²].

    by_place, by_speed: S and D over their sum, so that by_place·depth − by_speed·speed has the sign of a node's force.
    levels: how many levels there are.
    """

    frequency: float
    decay: float
    drags: bool
    pull: float
    by_place: float
    by_speed: float
    friction: float
    cutoff: float
    levels: int


class _Course(NamedTuple):
    """Where the cube is, how fast it is, and what is left to do.

    c: clearance of the lowest level [m]. u: speed along the normal [m/s]. j: how many levels press. slip [m/s] and way
    [m]: along the ground. left: of the time [s], and `lost` of that in rounding. event: that the last piece ended with.
    """

    c: float
    u: float
    j: int
    slip: float
    way: float
    left: float
    lost: float
    event: int


def unfit(scene: Scene, model: str) -> str | None:
    """Return in one sentence why this scheme does not apply, or None if it does."""
    if model in TURNING:
        return (
            f"scheme = exact, model = {model}: allowed is a model that does not turn the cube, such as sliding; "
            "scheme = event computes this one"
        )
    ground = scene.ground
    if ground.friction > 0 and scene.gravity > 0 and (ground.normal[0] != 0 or ground.normal[1] != 0):
        normal = ", ".join(f"{part:g}" for part in ground.normal)
        return (
            f"scheme = exact, ground.friction = {ground.friction:g}, ground.normal = [{normal}]: allowed is friction "
            "0, or level ground, [0, 0, 1], as gravity along the ground and friction together have no closed form; "
            "scheme = event computes this scene"
        )
    return None


@njit
def part(model: Any, physics: Physics, state: Any, h: float, tolerance: float, most: int) -> tuple[float, int, int]:
    """Advance `state` by h [s], or by less in as many pieces as are allowed; return what is left [s], pieces, and work.

    most: pieces at most.
    """
    fall = physics.weight / physics.mass
    normal = normal_of(physics)
    pull = fall * normal.z
    height = height_of(physics, state)
    u, along_ground = split(physics, vector(state.velocity))
    dragging = physics.damping > 0.0 and drags(physics)
    if not dragging and height - physics.reach + min(0.0, h * (u - h * max(0.0, pull) / 2)) > 0.0:
        flight(model, physics, state, h, 1, LAG)
        return 0.0, 1, 1
    slip = math.hypot(math.hypot(along_ground.x, along_ground.y), along_ground.z) if physics.friction > 0.0 else 0.0
    table = np.empty((3, 9))
    levels, lowest = fill(physics, state, table)
    before = height + lowest
    # Laid on the ground, to round-off of the place.
    start = 0.0 if u == 0.0 and abs(before) <= _LAID * (abs(height) + physics.reach) else before
    end, pieces = _advance(_ground_of(physics, dragging, pull, levels), table, start, u, slip, h, most)
    c, u, h = end.c, end.u, h - max(0.0, end.left)
    share, time = (end.slip / slip, end.way / slip) if slip > 0.0 else (1.0, h)
    # Gravity along the ground: none where there is friction.
    slope = pull * physics.nx, pull * physics.ny, pull * physics.nz - fall
    for axis in range(3):
        state.position[axis] += (time * along_ground[axis] + h * (h * slope[axis] / 2)) + (c - before) * normal[axis]
        state.velocity[axis] = (share * along_ground[axis] + h * slope[axis]) + u * normal[axis]
    if pieces > 1:
        # Near the ground the clearance is known to more digits than where it was before.
        gap = c - (height_of(physics, state) + lowest)
        for axis in range(3):
            state.position[axis] += gap * normal[axis]
    return end.left if math.isfinite(end.c) else 0.0, pieces, pieces


@njit
def _ground_of(physics: Physics, drags: bool, pull: float, levels: int) -> _Ground:
    stiffness, damping = physics.stiffness, physics.damping
    both = stiffness + damping
    by_place, by_speed = (stiffness / both, damping / both) if both > 0.0 else (1.0, 0.0)
    frequency, decay = math.sqrt(stiffness) / math.sqrt(physics.mass), damping / physics.mass / 2
    return _Ground(frequency, decay, drags, pull, by_place, by_speed, physics.friction, physics.cutoff, levels)


@njit
def _pressing(ground: _Ground, table: Array, c: float, u: float) -> int:
    """Return how many levels, from the lowest on, press on the ground."""
    j = 0
    if u < 0.0:
        while j < ground.levels and c + table[HEIGHT, j] <= 0.0:
            j += 1
    else:
        while j < ground.levels and ground.by_place * (c + table[HEIGHT, j]) + ground.by_speed * u < 0.0:
            j += 1
    return j


@njit
def _advance(
    ground: _Ground, table: Array, c: float, u: float, slip: float, h: float, most: int
) -> tuple[_Course, int]:
    """Go on for h [s], or so many pieces, from a clearance c [m] of the lowest level and a speed u [m/s] upwards.

    slip [m/s]: along the ground; zero where there is no friction. Return where that ends, and pieces.
    """
    now = _Course(c, u, _pressing(ground, table, c, u), slip, 0.0, h, 0.0, _NONE)
    pieces = 0
    while now.left > 0.0 and pieces < most:
        pieces += 1
        if now.u == 0.0:
            now = _wait(ground, table, now)
        free = now.j == 0 and now.c >= 0.0 and not ground.drags
        t = landing(ground.pull, now.c, now.u) if free else math.inf
        if t < now.left:
            now = _land(ground, now, t)
        elif now.left > 0.0:
            now = _move(ground, table, now)
    return now, pieces


@njit
def _springs(ground: _Ground, table: Array, j: int, c: float) -> float:
    """Return the acceleration by the springs of the lowest j levels [m/s²]."""
    return -ground.frequency * ground.frequency * (table[BELOW, j] * c + table[SUM, j])


@njit
def _wait(ground: _Ground, table: Array, now: _Course) -> _Course:
    """Take what is known ahead of a cube that stands still for a moment: rest, or swings about it."""
    omega = math.sqrt(table[BELOW, now.j]) * ground.frequency
    springs = _springs(ground, table, now.j, now.c)
    push = springs - ground.pull
    if abs(push) <= _STILL * (abs(ground.pull) + omega * omega * abs(now.c)):
        slip, slipped = evenly(now.slip, ground.cutoff, ground.friction * springs, now.left)
        return _Course(now.c, 0.0, now.j, slip, now.way + slipped, 0.0, 0.0, _NONE)
    cycles, period, decay = _cycles(ground, table, now.j, now.c, push, now.slip, now.left)
    if cycles > 0.0:
        moved = -push / omega / omega * math.expm1(-cycles * decay)
        slip, slipped = evenly(now.slip, ground.cutoff, ground.friction * ground.pull, cycles * period)
        way = now.way + slipped - (ground.friction * moved if slip > 0.0 else 0.0)
        left = now.left - cycles * period
        left = now.left % period if left < period else left  # without rounding, where these are all that fit
        return _Course(now.c + moved, 0.0, now.j, slip, way, left, 0.0, _NONE)
    return now


@njit
def _land(ground: _Ground, now: _Course, t: float) -> _Course:
    """Fly on to the ground, which the cube meets after t [s]."""
    u = -math.sqrt(max(0.0, now.u * now.u + 2 * ground.pull * now.c))
    left, lost = _later(now, t)
    return _Course(0.0, u, 1, now.slip, now.way + now.slip * t, left, lost, _TOUCH)


@njit
def _move(ground: _Ground, table: Array, now: _Course) -> _Course:
    """Go on to the next event."""
    nodes, push = table[BELOW, now.j], _springs(ground, table, now.j, now.c) - ground.pull
    falls = now.u < 0.0 or (now.u == 0.0 and push < 0.0)
    beta = ground.decay * (table[BELOW, ground.levels] if ground.drags and falls else nodes)
    motion = Oscillator(math.sqrt(nodes) * ground.frequency, beta, push, now.u)
    turn = first_zero(motion.omega, beta, now.u, push - 2 * beta * now.u)
    if falls:
        t, event = _sink(table, motion, now.j, ground.levels, now.c, min(turn, now.left))
    else:
        t, event = _rise(ground, table, motion, now.j, now.c, min(turn, now.left), now.event == _PRESS)
    moved, u = after(motion, t)
    slip, slipped = along(motion, ground.pull, ground.friction, now.slip, ground.cutoff, t)
    c, j = now.c + moved, now.j
    if event == _NONE:
        u = 0.0 if t == turn else u
    else:
        j += -1 if event == _RELEASE else 1
        # To the last digit, where the place alone decides.
        if t > 0.0 and (event == _TOUCH or ground.decay == 0.0):
            c = -table[HEIGHT, min(j, now.j)]
    left, lost = _later(now, t)
    return _Course(c, u, j, slip, now.way + slipped, left, lost, event)


@njit
def _later(now: _Course, t: float) -> tuple[float, float]:
    """Return what is left of the time after t [s], and what rounding has lost of it so far (Kahan's sum)."""
    spent = t + now.lost
    left = now.left - spent
    return left, (left - now.left) + spent


@njit
def _sink(table: Array, motion: Any, j: int, levels: int, c: float, end: float) -> tuple[float, int]:
    """Return when [s] the first event of a falling cube is, at `end` at the latest, and which."""
    if j < levels:
        gap = c + table[HEIGHT, j]
        pace = motion.push - 2 * motion.beta * motion.speed
        t = passing(motion, 1.0, 0.0, gap, -1.0, 0.0, end, landing(-pace, max(0.0, gap), motion.speed))
        if t <= end:
            return t, _TOUCH
    return end, _NONE


@njit
def _rise(ground: _Ground, table: Array, motion: Any, j: int, c: float, end: float, pressed: bool) -> tuple[float, int]:
    """Return the same for a rising cube.

    A level at a height a presses while x = by_place·(c + a) + by_speed·u is negative. As x' is zero once at most before
    the cube turns, x goes one way until then, and the other way from there. A level that has just pressed does not let
    go at once: deep in a strong damping both forces are large, and which is larger is lost in round-off.
    """
    pace = motion.push - 2 * motion.beta * motion.speed
    value = ground.by_place * motion.speed + ground.by_speed * pace
    # In an order that leaves the range of doubles last.
    slope = ground.by_place * pace - 2 * motion.beta * (ground.by_speed * pace)
    slope -= ground.by_speed * motion.omega * (motion.omega * motion.speed)
    climbs = value > 0.0 or (value == 0.0 and slope > 0.0)
    low, high = 0.0, min(end, first_zero(motion.omega, motion.beta, value, slope))
    for _ in range(2):
        level = j - 1 if climbs else j
        if low < high and 0 <= level < ground.levels:
            gap = ground.by_place * (c + table[HEIGHT, level])
            t = passing(motion, ground.by_place, ground.by_speed, gap, 1.0 if climbs else -1.0, low, high, math.nan)
            if t <= high and not (climbs and pressed and t == 0.0):
                return t, _RELEASE if climbs else _PRESS
        climbs = not climbs
        low, high = high, end
    return end, _NONE


@njit
def _cycles(
    ground: _Ground, table: Array, j: int, c: float, push: float, slip: float, left: float
) -> tuple[float, float, float]:
    """Return how many cycles, how long [s] each, and by which power of e [1] the amplitude shrinks in each.

    Of a cube that stands still for a moment and will never again change how many levels press: zero where it may. A
    cycle falls at one damping and rises at another, for half a period each.

    Friction slows a sliding cube on average as its weight does. In the slip's z of `regularised_friction.py` as a
    function of the loss, expanded about the average, the swing of size y changes the way by less than 5 μ y
    cutoff/(slip + cutoff), as long as the slip is large against the speed of the swing; its part without the cutoff has
    a closed form.
    """
    nodes = table[BELOW, j]
    if not nodes * ground.frequency > 0.0:
        return 0.0, 0.0, 0.0
    omega = math.sqrt(nodes) * ground.frequency
    rising = ground.decay * nodes
    falling = ground.decay * (table[BELOW, ground.levels] if ground.drags else nodes)
    if not falling < omega:
        return 0.0, 0.0, 0.0
    size, rest = abs(push) / omega / omega, c + push / omega / omega
    highest = ground.by_place * (rest + size + table[HEIGHT, j - 1]) + ground.by_speed * omega * size
    if not highest <= _STILL * ground.by_place * size or (
        j < ground.levels and not rest - size + table[HEIGHT, j] > 0.0
    ):
        return 0.0, 0.0, 0.0
    up = math.sqrt(omega - rising) * math.sqrt(omega + rising)
    down = math.sqrt(omega - falling) * math.sqrt(omega + falling)
    period = math.pi / up + math.pi / down
    cycles = np.floor(left / period)
    if slip > 0.0:
        slowest = max(0.0, 1000 * ground.friction * omega * size - ground.cutoff)
        stops = (slip - slowest) / (ground.friction * ground.pull)
        if slowest > 0.0:
            cycles = min(cycles, np.floor(stops / period))
        unseen = 5 * ground.friction * size * ground.cutoff / (slowest + ground.cutoff)
        if not unseen <= _UNSEEN * min(cycles * period, stops) * slip / 2:
            return 0.0, 0.0, 0.0
    return cycles, period, math.pi * (rising / up + falling / down)
