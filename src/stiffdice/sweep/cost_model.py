"""The predicted work of the cells of a sweep, so that jobs get equal shares.

`docs/explanation/cost.md` derives the formula.

A run is followed as a ball that bounces, landing by landing: how long it rises, falls, touches and rests. From this
follows how many steps are computed one by one. Nothing is simulated.

Whoever plans a sweep and whoever computes a part of it cut it at the same cells, maybe on different processors. So only
sums, products, quotients, square roots and comparisons are used, element by element: IEEE 754 rounds these in one way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from stiffdice.dynamics.state import TOUCHING, TURNING, Array
from stiffdice.simulation.backend import DEFAULT_SCHEME, OURS
from stiffdice.sweep.grid import Piece, Sweep

# Seconds of a step of a cube that keeps its orientation, and of one that turns; and of the start of a run. Of engines
# and of our own schemes, on one core of an AMD EPYC (Zen 5) at 3.9 GHz; OTHER: of any that is not here.
PRICES = {
    "symplectic_euler": (9e-8, 1.2e-7, 1e-5),
    "forward_euler": (7.5e-8, 1.6e-7, 1e-5),
    "velocity_verlet": (1.2e-7, 2.6e-7, 1e-5),
    "rk4": (2.3e-7, 5.8e-7, 1e-5),
    "implicit_euler": (1.3e-6, 1.9e-6, 1e-5),
    "exact": (1.1e-6, 1.1e-6, 1e-5),
    "event": (1.8e-6, 2.9e-6, 1e-5),
    "mujoco": (2.5e-6, 2.8e-6, 2.2e-3),
    "pybullet": (6.5e-6, 7e-6, 2.5e-2),
    "drake": (2.8e-5, 3e-5, 5e-3),
    "dart": (2.5e-5, 3e-5, 1e-3),
    "scipy": (1e-7, 1e-7, 5e-2),
    "octave": (1.6e-4, 2.2e-4, 3e-3),
    "numpy": (1.8e-5, 5.8e-5, 1e-4),
}
OTHER = (1e-6, 2e-6, 1e-3)

# Of the default scheme, a step that is compared with no reference; the same, of a member beside others in drag.
UNSEEN, ASIDE = (2e-8, 4.5e-8), (1.8e-9, 8.5e-9)

FEWEST = 4  # members that go beside each other

# Seconds of Python for a cell, and for each block of so many members.
CELL, BLOCK, MEMBERS = 4.5e-4, 2.5e-4, 64

# Seconds of a reference: of its launch, and of each contact.
REFERENCE, CONTACT = 2e-3, 2e-5

# Steps of a landing besides those of its contact. A run that is compared is looked at so many times; flights are
# skipped where there are so many steps from look to look, and a look then costs as much as a step.
AROUND, LOOKS, FEWEST_BETWEEN = 60.0, 2048, 7.0

# A cube that turns lands on two corners, and then has so much of its speed along the normal; friction takes its part.
CORNERS, UPWARDS, RUBBED = 2.0, 0.7071067811865476, 0.35

# A rest is known up to this ωh, if its swing may grow by no more than so many e-foldings.
LONGEST_HELD, SWING_GROWS, SWING_SHRINKS = 0.5, 0.3, 15.0

# A landing gains up to (ωh)²/4 of the energy, most of them less: gains reach a tolerance after so many times as many.
GAIN, UNTIL_FAILED = 0.25, 18.0

# Landings that lose less than this part of their speed are followed several at a time, so many times at most.
ALIKE, MOST = 0.1, 100

_PI = 3.141592653589793


def of(sweep: Sweep, pieces: Sequence[Piece]) -> Array:
    """Return the predicted seconds of each cell of some pieces, piece by piece, shape (cell,).

    A cell costs the same wherever it is, but for the references of `trajectory`, which the cells of a piece share.
    """
    counts = np.array([len(piece.steps) for piece in pieces], np.int64)
    steps = np.array([steps for piece in pieces for steps in piece.steps], np.float64)
    column = np.repeat(np.arange(len(pieces)), counts)
    compared = min(sweep.horizon, sweep.scene.duration) if "trajectory" in sweep.criteria else 0.0
    default = (sweep.simulator, sweep.scheme) == (OURS, DEFAULT_SCHEME)
    aside = default and sweep.members >= FEWEST and compared == 0.0
    blocks = -(-sweep.members // MEMBERS)
    # At the extremes a time or a speed leaves the range of doubles: then a run is one of all its steps.
    with np.errstate(all="ignore"):
        ball, course = _bounces(sweep, pieces, np.array([[compared], [sweep.scene.duration]]), aside)
        work = _run(sweep, compared, aside, steps, ball[:, column], course[..., column])
        if compared:
            launches = sweep.members if sweep.model in TURNING else 1.0
            contacts = np.fmin(course[-1, 0], LOOKS)
            work = work + ((REFERENCE + CONTACT * contacts) * launches / counts / sweep.members)[column]
    return np.asarray(CELL + blocks * BLOCK + sweep.members * work)


def _bounces(sweep: Sweep, pieces: Sequence[Piece], until: Array, aside: bool) -> tuple[Array, Array]:
    """Return how a cube bounces on the ground of each piece, and for how long it does what `until` [s], shape (2, 1).

    Of the ball, shape (4, column): drag [1/s], ω [1/s], the part of the speed that a landing gives back, and when the
    first is [s]. Of its course, shape (4, 2, column): times [s] that are stepped through, that can be skipped, and of
    rest; and the number of landings.
    """
    scene, turning = sweep.scene, sweep.model in TURNING
    ground, launch, normal = scene.ground, scene.launch, scene.ground.normal
    stiffness = np.array([piece.column.stiffness for piece in pieces], np.float64)
    dragging = np.array([piece.column.contact == "ungated" for piece in pieces], np.bool_)
    pull = scene.gravity * normal[2]
    drag = np.where(dragging, 8 * ground.damping / scene.cube.mass, 0.0)
    omega = 2.0 * np.sqrt(stiffness) / math.sqrt(scene.cube.mass)
    # e = exp(−πζ) to second order, ζ = D/√(S m).
    loss = 2 * _PI * ground.damping / omega / scene.cube.mass
    kept, touch = 1 / (1 + loss + 0.5 * loss * loss), _PI / omega
    clearance = np.fmax(0.0, _dot(normal, launch.position) - 0.5 * scene.cube.side)
    upwards = launch.velocity[2] if sweep.model == "vertical" else _dot(normal, launch.velocity)
    climb = np.float64(upwards) / pull
    fall, speed = _fall(pull, drag, clearance + 0.5 * climb * upwards)
    lands = (stiffness > 0.0) & (sweep.model in TOUCHING) & (pull > 0.0)
    first, climb = np.where(lands, np.fmax(0.0, climb + fall), math.inf), np.float64(max(0.0, climb))
    if turning:
        kept, touch, speed = kept / (1 + RUBBED * min(1.0, ground.friction)), CORNERS * touch, UPWARDS * speed
    time, rising = np.fmin(first, until), np.fmin(climb, until)
    falling, resting, landings = np.fmax(0.0, time - climb), np.zeros(time.shape), np.zeros(time.shape)
    for _ in range(MOST):
        going = time < until
        if not going.any():
            break
        leaving = speed * kept
        rise = leaving / pull
        drop, again = _fall(pull, drag, 0.5 * rise * leaving)
        lost, whole = 1 - again / speed, touch + rise + drop
        # Slower than that it does not get out of the sag of its rest.
        rests = going & ~(leaving * omega > pull)
        alike = np.where(going & ~rests, np.fmin((until - time) / whole, np.fmax(1.0, ALIKE / lost)), 0.0)
        landings = landings + alike + rests
        resting = np.where(rests, until - time, resting)
        rising, falling = rising + alike * rise, falling + alike * drop
        time, speed = np.where(rests, until, time + alike * whole), speed - alike * lost * speed
    slow = np.where(drag > 0.0, falling + (rising if aside or turning else 0.0), 0.0)
    course = np.stack([landings * touch + slow, rising + falling - slow, resting, landings])
    return np.stack([drag, omega, kept, first]), course


def _dot(p: Sequence[float], q: Sequence[float]) -> float:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def _fall(pull: float, drag: Array, height: Array) -> tuple[Array, Array]:
    """Return how long [s] a fall from rest takes, and how fast [m/s] it ends, in a drag that grows with the speed.

    With v₀ = √(2 g height), vₜ = g/drag and a = v₀/vₜ the speed is v₀ over the root of 1 + 2a/3 + 5a²/18 + …, and vₜ
    where a is large. The time follows exactly: the drag takes drag·height of the speed, however the fall goes.
    """
    free = np.sqrt(2 * pull * height)
    a = free * drag / pull
    speed = free / np.sqrt(1 + 2 * a / 3 + (5 + 6 * a) / (18 + 6 * a) * a * a)
    return (speed + drag * height) / pull, speed


def _run(sweep: Sweep, compared: float, aside: bool, steps: Array, ball: Array, course: Array) -> Array:
    """Return the seconds of one run of each cell, shape (cell,); ball, course: as of `_bounces`, by cell."""
    (drag, omega, kept, first), (stepped, skipped, (_, resting), landings) = ball, course
    duration, ours, turning = sweep.scene.duration, sweep.simulator == OURS, sweep.model in TURNING
    *prices, start = PRICES.get(sweep.scheme if ours else sweep.simulator, OTHER)
    seen, h, default = prices[turning], duration / steps, ours and sweep.scheme == DEFAULT_SCHEME
    omega_h, rests, known = omega * h, duration - resting, np.full(h.shape, math.inf)
    if default and not turning:  # from when on [s] a cube is known to rest
        decay = np.float64(sweep.scene.ground.damping / sweep.scene.cube.mass)
        grows = SWING_GROWS * duration * np.where(drag > 0.0, 8.0, 4.0) * decay * omega_h * omega_h
        is_known = (rests < duration) & (omega_h <= LONGEST_HELD) & (grows <= SWING_SHRINKS)
        known = np.where(is_known, rests + (1.0 + grows) / (4.0 * decay), math.inf)
    ends = np.full(h.shape, duration)
    if sweep.early_stop and "finite" not in sweep.criteria:  # once the last criterion fails, or can fail no more
        gain, lost = GAIN * omega_h * omega_h, 1 - kept * kept
        between, last = (duration - first) / np.fmax(1.0, landings[1]), np.full(h.shape, compared)
        for tolerance in (tolerance for name, tolerance in sweep.criteria.items() if name != "trajectory"):
            fails = np.where(gain > lost, first + between * UNTIL_FAILED * (tolerance + lost) / gain, math.inf)
            last = np.fmax(last, np.fmin(known, fails))
        ends = np.fmin(duration, np.fmax(last, h))
    if not ours:
        return np.asarray(start + seen * np.fmin(steps, ends / h))
    # Of flights that can be skipped some steps around each landing are computed.
    near, flown = AROUND * landings, skipped / h
    before, whole = stepped / h + np.where(flown > 0.0, near * flown / (near + flown), 0.0)
    early = np.where(compared / LOOKS >= FEWEST_BETWEEN * h, before + LOOKS, compared / h)
    early = np.fmin(compared / h, early * _share(ends, 0.0, compared))
    late = np.fmax(0.0, whole - before) * _share(ends, compared, rests)
    late = late + np.fmax(0.0, np.fmin(ends, known) - np.fmax(rests, compared)) / h
    unseen = np.where((drag > 0.0) & aside, ASIDE[turning], UNSEEN[turning] if default else seen)
    return np.asarray(start + seen * early + unseen * np.fmin(steps, late))


def _share(ends: Array, start: float, end: Array | float) -> Array:
    """Return the part of the time from start to end that is over when runs end."""
    return np.asarray(np.fmin(1.0, np.fmax(0.0, ends - start) / np.fmax(0.0, end - start)))
