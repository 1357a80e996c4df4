"""How long the cells of a scan will take, told before any of them runs, so that jobs get equal shares of the work.

A run is followed landing by landing, as a ball of which the ground gives back a part of its speed: how long it rises,
falls, touches and rests. Which of that is stepped, and which is taken at once, is known of every contact law, model and
scheme; the time stepped over the step size is the number of steps computed. `docs/cost.md` derives the formula, and
says how good it is.

Whoever plans a sweep and whoever computes a part of it both ask, maybe on different processors, and have to cut it at
the same cells. So there are sums, products, quotients, square roots and comparisons only, which IEEE 754 rounds in one
way everywhere; what would need a logarithm or an exponential has a rational function or a literal instead. Nothing is
simulated, and nothing compiled is loaded.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import TOUCHING, TURNING, Array
from stiffdice.scene.scene import Scene

OURS, PAPERS = "stiffdice", "symplectic_euler"

Flags = npt.NDArray[np.bool_]

_PI = 3.141592653589793


class Price(NamedTuple):
    """Seconds of a step of a cube that rises only, slides, slides without friction, turns; and of a contact itself."""

    rising: float
    sliding: float
    slipping: float
    turning: float
    contact: float = 0.0

    def step(self, model: str, friction: float) -> float:
        """Return the seconds of a step of a model."""
        if model in TURNING:
            return self.turning
        if model == "vertical":
            return self.rising
        return self.sliding if friction > 0.0 else self.slipping


# All on one core of an AMD EPYC (Zen 5) at 3.9 GHz. A step that is looked at, by scheme:
STEP = {
    "symplectic_euler": Price(8e-8, 9e-8, 9e-8, 1.2e-7),
    "forward_euler": Price(5.5e-8, 7.5e-8, 7.5e-8, 1.6e-7),
    "velocity_verlet": Price(6.8e-8, 1.2e-7, 1.2e-7, 2.6e-7),
    "rk4": Price(1.7e-7, 2.3e-7, 2.3e-7, 5.8e-7),
    "implicit_euler": Price(1.3e-6, 1.3e-6, 5.6e-7, 1.9e-6),
    "exact": Price(2.1e-7, 1.05e-6, 2.1e-7, 1.05e-6, 2e-6),
    "event": Price(3.4e-6, 1.8e-6, 1.6e-6, 2.9e-6, 1.5e-5),
}

# Part of that while nothing acts on the cube.
IDLE = 0.7

# A step of the paper's scheme that nobody looks at (`batch_loop.py`).
UNSEEN = Price(2e-8, 2e-8, 2e-8, 4.5e-8)


class Lanes(NamedTuple):
    """Members side by side (`batch_loop.py`): seconds of a step of all of them, and how many they are at most."""

    step: float
    width: int


LANES = {"sliding": Lanes(5.2e-8, 32), "tumbling": Lanes(1.36e-7, 16)}
FEWEST = 4  # members that go side by side
HOPPING = 6.0  # steps that one costs where a cube at rest hops for ever, and each hop of each member stops all


class Engine(NamedTuple):
    """Seconds of a step while the cube only moves, of one while it turns, of the start of a run, and of a contact."""

    moving: float
    turning: float
    start: float
    contact: float = 0.0


ENGINES = {
    "mujoco": Engine(2.5e-6, 2.8e-6, 2.2e-3),
    "pybullet": Engine(6.5e-6, 7.0e-6, 2.5e-2),
    "drake": Engine(2.8e-5, 3.0e-5, 5e-3),
    "scipy": Engine(7e-8, 7e-8, 2e-4, 8e-4),
    "octave": Engine(1.6e-4, 2.2e-4, 3e-3),
    "numpy": Engine(1.8e-5, 5.8e-5, 1e-4),
}

# Seconds of Python: to store a cell; to run and store a block of its members; to put a launch into its phase, and to
# turn it, too.
CELL, CALL, MEMBER, MEMBER_TURNED = 4.5e-4, 2.5e-4, 2.5e-6, 2.2e-5

# Seconds of a leap over a flight, and of a step that looks for a phase to leap over.
LEAP, PHASED_STEP = 6.5e-8, 1.2e-7

BLOCK = 64  # members of one call (`sweep.BLOCK`)
FIRST_STATES = 256  # that an engine makes before anybody looks (`driver.py`)

# Steps of a landing besides those of its contact: the last ones of the flight, too few to be skipped
# (`fast_forward.WORTHWHILE`), and those after it until a flight is looked for again: a few, or `batch_loop.LONGEST`.
NEAR, SOON, LATE = 8.0, 4.0, 64.0

# Of a cube that slides freely a contact is known by phases of a quarter of 1/ω at most (`fast_forward.py`). They are
# worth it from ten steps on, ωh = 1/40; then a contact takes about so many steps, and a fall in drag so many.
PHASE, PHASED_CONTACT, PHASED_FALL, FEWEST_PHASED = 0.025, 30.0, 20.0, 10

# A rest is known up to this ωh (`phases.resting_swing`), when its swing has shrunk by as many e-foldings as it might
# grow, 0.3 times steps, damping of a step and (ωh)²; round-off leaves about so many.
LONGEST_HELD, SWING_GROWS, SWING_SHRINKS = 0.5, 0.3, 15.0

# Samples of a reference (`reference.py`). Steps between two of them, from which on something is skipped.
SAMPLES, FEWEST_BETWEEN = 2048, 8
# Seconds of a reference: of its launch, of a contact, of a sample where the cube is acted on, and where it turns as it
# touches; of 1/ω of a rest, and of the longest, after which nothing moves.
REFERENCE, REFERENCE_CONTACT, REFERENCE_SAMPLE, REFERENCE_TOUCHING = 4e-4, 2e-5, 3e-6, 4e-6
REFERENCE_REST, REFERENCE_LONGEST_REST = 4e-6, 0.16

# A cube that turns lands on two corners, one after the other, and after its first landing has half of its energy, on
# average, in its spin. Friction leaves 1/(1 + RUBBED·mu) of its speed each time.
CORNERS, UPWARDS, RUBBED = 2.0, 0.7071067811865476, 0.35

# Centre over ground of a cube on it, in sides, on average over its orientations.
MEAN_HEIGHT = 0.75

# Friction takes a constant share of a speed far below its cutoff, step by step: after so many e-foldings it is zero. It
# is looked for in so many equal parts of the time that is left when friction has stopped the cube.
UNDERFLOW, PARTS = 745.0, 8

# From which ωh on cells of a scheme that damps are taken together.
DAMPED = {"implicit_euler": (0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 1.28)}

# How much energy a landing gains, at worst, as c₁ ωh + c₂ (ωh)², by scheme; of those not named, none.
GAIN = {
    "symplectic_euler": (0.0, 0.25),
    "velocity_verlet": (0.0, 0.25),
    "forward_euler": (3.0, 0.0),
    "rk4": (0.0, 0.02),
}

# Landings until gains have added up to a tolerance, times tolerance over gain: most are smaller than the worst.
UNTIL_FAILED = 18.0

# Landings that lose less than this part of their speed are followed several at a time, so many times at most.
ALIKE, MOST = 0.1, 300


class Prediction(NamedTuple):
    """Of each cell of a scan, shape (scan,) each: seconds of all that it costs; steps computed one by one in a run."""

    seconds: Array
    steps: Array


def of_scan(
    scene: Scene,
    *,
    model: str,
    scheme: str,
    simulator: str,
    steps: Sequence[int],
    members: int,
    criteria: Mapping[str, float],
    early_stop: bool,
    horizon: float,
) -> Array:
    """Return the predicted seconds of each cell of a scan on one ground, shape (scan,), on a core as docs/cost.md says.

    steps: of each cell, at least 1, in any order. criteria: tolerances of those asked. horizon [s]: until when
    `trajectory` compares; what its references cost is spread over the cells. The same numbers, to the last bit, on
    every processor. Raises KeyError for a scheme or a simulator that is not known.
    """
    return prediction(
        scene,
        model=model,
        scheme=scheme,
        simulator=simulator,
        steps=steps,
        members=members,
        criteria=criteria,
        early_stop=early_stop,
        horizon=horizon,
    ).seconds


def prediction(
    scene: Scene,
    *,
    model: str,
    scheme: str,
    simulator: str,
    steps: Sequence[int],
    members: int,
    criteria: Mapping[str, float],
    early_stop: bool,
    horizon: float,
) -> Prediction:
    """Return what `of_scan` does, and the steps that it counts with."""
    counts = np.asarray(steps, np.float64)
    h, ball = scene.duration / counts, _ball_of(scene, model)
    compared = min(horizon, scene.duration) if "trajectory" in criteria else 0.0
    calls = -(-members // BLOCK)
    fixed = CELL + calls * CALL + members * (MEMBER_TURNED if model in TURNING else MEMBER)
    if compared > 0.0:
        launches = members + calls if model in TURNING else 2 * calls
        fixed += launches * _reference(ball, compared) / max(1, len(counts))
    way = _way_of(scene, ball, model, scheme, members, compared) if simulator == OURS else None
    seconds, computed = np.zeros(h.shape), np.zeros(h.shape)
    # At the extremes a time or a speed leaves the range of doubles: then a run is one of all its steps.
    with np.errstate(all="ignore"):
        for alike, slowed in _alike(scheme, ball, h):
            ends = held = np.full(h[alike].shape, math.inf)
            if way is not None and scheme == PAPERS:
                held = _held(scene, slowed, model, h[alike])
            if early_stop:
                ends = _decided(scene, slowed, scheme, h[alike], criteria, compared, held)
            ends = np.fmin(scene.duration, ends)
            if way is None:
                run = _engine_run(ENGINES[simulator], slowed, model, scene.duration, h[alike], ends)
            else:
                run = _run(scene, slowed, way, h[alike], ends, compared, held)
            seconds[alike], computed[alike] = run
        return Prediction(fixed + members * seconds, np.fmin(counts, computed))


def _alike(scheme: str, ball: _Ball, h: Array) -> list[tuple[Flags, _Ball]]:
    """Return cells that bounce alike, each with its ball: a scheme that damps gives back less, the longer its steps.

    Implicit Euler gives back exp(−π ωh/2) of the speed (docs/engines.md), here to second order.
    """
    if scheme not in DAMPED:
        return [(np.full(h.shape, True), ball)]
    groups, omega_h = [], ball.omega * h
    for low, high in zip((0.0, *DAMPED[scheme]), (*DAMPED[scheme], math.nan), strict=True):
        loss = 0.75 * _PI * low  # amid low and twice that
        kept = ball.kept / (1.0 + loss + 0.5 * loss * loss)
        # Not `low <= omega_h < high`: what is infinite or no number has to be in a group, too.
        groups.append((~(omega_h < low) & ~(omega_h >= high), ball._replace(kept=kept)))
    return groups


def _engine_run(engine: Engine, ball: _Ball, model: str, duration: float, h: Array, ends: Array) -> tuple[Array, Array]:
    """Return the seconds of one run by an engine, and its steps: all, until it is decided."""
    made = np.fmin(duration / h, ends / h + FIRST_STATES)
    contacts = np.fmin(_course(ball, duration).contacts, duration / h)
    step = engine.turning if model in TURNING else engine.moving
    return engine.start + engine.contact * contacts + step * made, ends / h


class _Course(NamedTuple):
    """What becomes of a run until some time: how long [s] it climbs from its launch, rises, falls, touches, rests.

    contacts: how many there are. speed [m/s]: of the last landing.
    """

    climbing: float = 0.0
    rising: float = 0.0
    falling: float = 0.0
    touching: float = 0.0
    resting: float = 0.0
    contacts: float = 0.0
    speed: float = 0.0

    def beyond(self, shorter: _Course) -> _Course:
        """Return what is more of everything in this course than in a shorter one of the same run."""
        more = [mine - its for mine, its in zip(self[:-1], shorter[:-1], strict=True)]
        return _Course._make([*more, shorter.speed])


class _Ball(NamedTuple):
    """A cube that bounces: pull [m/s²], and drag [1/s] of a fall; its launch.

    kept: part of the speed that a contact gives back; omega [1/s]: of a contact; contacts: of a landing; upwards: part
    of the speed that is along the normal after the first landing. climb [s], fall [s] and landing [m/s]: how long it
    climbs from its launch and falls then, and how fast it lands; one of the two is infinite if it does not. dragless
    [m/s]: how fast it would land without drag.
    """

    pull: float
    drag: float
    kept: float
    omega: float
    contacts: float
    upwards: float
    climb: float
    fall: float
    landing: float
    dragless: float


def _ball_of(scene: Scene, model: str) -> _Ball:
    ground, cube, launch = scene.ground, scene.cube, scene.launch
    turning = model in TURNING
    nx, ny, nz = ground.normal
    pull = scene.gravity * nz
    drag = 8 * ground.damping / cube.mass if ground.contact == "ungated" else 0.0
    if model not in TOUCHING:
        return _Ball(pull, drag, 1.0, math.inf, 1.0, 1.0, math.inf, 0.0, 0.0, 0.0)
    if not (ground.stiffness > 0.0 and pull > 0.0):
        return _Ball(pull, drag, 1.0, math.inf, 1.0, 1.0, 0.0, math.inf, 0.0, 0.0)
    omega = linear_theory.contact_frequency(ground.stiffness, cube.mass)
    # e = exp(−πζ) to second order, ζ = D/√(S m).
    loss = 2 * _PI * ground.damping / omega / cube.mass
    kept = 1 / (1 + loss + 0.5 * loss * loss)
    level = MEAN_HEIGHT if turning or any(launch.orientation) else 0.5 * (abs(nx) + abs(ny) + abs(nz))
    clearance = max(0.0, _dot(ground.normal, launch.position) - level * cube.side)
    speed = launch.velocity[2] if model == "vertical" else _dot(ground.normal, launch.velocity)
    apex = clearance + speed * speed / (2 * pull)
    fall, landing = _fall(pull, drag, apex)
    dragless = math.sqrt(2 * pull * apex)
    fall -= max(0.0, -speed) / pull
    climb = max(0.0, speed) / pull
    if not turning:
        return _Ball(pull, drag, kept, omega, 1.0, 1.0, climb, fall, landing, dragless)
    kept /= 1 + RUBBED * min(1.0, ground.friction)
    return _Ball(pull, drag, kept, omega, CORNERS, UPWARDS, climb, fall, landing, dragless)


def _dot(p: Sequence[float], q: Sequence[float]) -> float:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def _fall(pull: float, drag: float, height: float) -> tuple[float, float]:
    """Return how long [s] a fall from rest takes, and how fast [m/s] it ends, in a drag that grows with the speed.

    With v₀ = √(2 g height), vₜ = g/drag and a = v₀/vₜ the speed is v₀ over the root of 1 + 2a/3 + 5a²/18 + …, and vₜ
    where a is large. The time follows exactly: the drag takes drag·height of the speed, however the fall goes.
    """
    free = math.sqrt(2 * pull * height)
    a = free * drag / pull
    speed = free / math.sqrt(1 + 2 * a / 3 + (5 + 6 * a) / (18 + 6 * a) * a * a)
    return (speed + drag * height) / pull, speed


def _course(ball: _Ball, until: float) -> _Course:
    """Return the course of a run up to a time [s]."""
    first, speed = ball.climb + ball.fall, ball.landing
    if not first < until:
        climb = min(ball.climb, until)
        return _Course(climbing=climb, falling=until - climb, speed=speed)
    contact = ball.contacts * _PI / ball.omega
    time, speed, landings = first, speed * ball.upwards, 0.0
    rising = falling = resting = 0.0
    for _ in range(MOST):
        if not time < until:
            break
        leaving = speed * ball.kept
        # Slower than that it does not get out of the sag of its rest.
        if not leaving * ball.omega > ball.pull:
            landings += 1.0
            resting = max(0.0, until - time - contact)
            break
        rise = leaving / ball.pull
        drop, again = _fall(ball.pull, ball.drag, 0.5 * rise * leaving)
        lost, left = 1.0 - again / speed, (until - time) / (contact + rise + drop)
        alike = max(1.0, min(left, ALIKE / lost) if lost > 0.0 else left)
        landings, rising, falling = landings + alike, rising + alike * rise, falling + alike * drop
        time += alike * (contact + rise + drop)
        speed -= alike * lost * speed
    # The last flight goes beyond the end; or there are more landings, like these.
    part = 1.0 if resting > 0.0 or not time > first else (until - first) / (time - first)
    return _Course(
        ball.climb,
        part * rising,
        ball.fall + part * falling,
        part * landings * contact,
        resting,
        part * landings * ball.contacts,
        speed,
    )


def _held(scene: Scene, ball: _Ball, model: str, h: Array) -> Array:
    """Return from when on [s] the cube is known to rest, shape of h; infinite if never."""
    resting = _course(ball, scene.duration).resting
    if model in TURNING or not (resting > 0.0 and scene.ground.damping > 0.0):
        return np.full(h.shape, math.inf)
    omega_h, decay = ball.omega * h, scene.ground.damping / scene.cube.mass
    dragging = 8.0 if scene.ground.contact == "ungated" else 4.0
    grows = SWING_GROWS * scene.duration * dragging * decay * omega_h * omega_h
    known = (omega_h <= LONGEST_HELD) & (grows <= SWING_SHRINKS)
    return np.where(known, scene.duration - resting + (1.0 + grows) / (4.0 * decay), math.inf)


def _decided(
    scene: Scene,
    ball: _Ball,
    scheme: str,
    h: Array,
    criteria: Mapping[str, float],
    compared: float,
    held: Array,
) -> Array:
    """Return when [s] the last of the criteria is decided, shape of h: it fails, or can fail no more.

    What a landing gains, of its energy, is spread over members and adds up from one to the next; damping and drag take
    their part of it.
    """
    if "finite" in criteria or not criteria:
        return np.full(h.shape, scene.duration)
    omega_h = ball.omega * h
    by_step, by_square = GAIN.get(scheme, (0.0, 0.0))
    gain = by_step * omega_h + by_square * omega_h * omega_h
    course, first = _course(ball, scene.duration), ball.climb + ball.fall
    between = (scene.duration - first) / max(1.0, course.contacts)
    kept = ball.kept * ball.landing / ball.dragless if ball.dragless > 0.0 else 1.0
    lost = 1 - kept * kept
    last = np.zeros(h.shape)
    for name, tolerance in criteria.items():
        if name == "trajectory":
            failing = first + 2 * tolerance * scene.cube.radius / (gain * ball.landing)
            last = np.fmax(last, np.fmin(compared, failing))
        else:
            failing = np.where(gain > lost, first + between * UNTIL_FAILED * (tolerance + lost) / gain, math.inf)
            last = np.fmax(last, np.fmin(held, failing))
    return np.asarray(np.fmax(last, h))


def _reference(ball: _Ball, horizon: float) -> float:
    """Return the seconds of one reference."""
    course = _course(ball, horizon)
    acted = course.resting + (course.falling if ball.drag > 0.0 else 0.0)
    sampled = REFERENCE_SAMPLE * acted + (REFERENCE_TOUCHING * course.touching if ball.contacts > 1.0 else 0.0)
    seconds = REFERENCE + REFERENCE_CONTACT * course.contacts + SAMPLES * sampled / horizon
    if course.resting > 0.0:
        seconds += min(REFERENCE_REST * ball.omega * course.resting, REFERENCE_LONGEST_REST)
    return seconds if seconds < math.inf else REFERENCE


class _Way(NamedTuple):
    """How a run is made: whether climb, rises and falls are stepped; steps after a lift-off until a flight is skipped.

    free: from when on [s] the cube may slide freely, or not at all. seen, unseen: seconds of a step that is looked at,
    and of one that is not; contact: of one, beyond its steps; hopping, creeping: of a step at rest beyond `unseen`,
    where it is long, and where it is short but the rest is not known.
    """

    climbs: bool
    rises: bool
    falls: bool
    late: float
    free: float
    seen: float
    unseen: float
    contact: float
    hopping: float = 0.0
    creeping: float = 0.0


def _way_of(scene: Scene, ball: _Ball, model: str, scheme: str, members: int, compared: float) -> _Way:
    turning = model in TURNING
    dragging = model in TOUCHING and scene.ground.contact == "ungated"
    friction, price = scene.ground.friction, STEP[scheme]
    seen, turned = price.step(model, friction), dragging and turning
    if scheme != PAPERS:
        return _Way(turned, turned, dragging, SOON, math.inf, seen, seen, price.contact)
    free, level = _free(scene, ball, model), scene.ground.normal == (0.0, 0.0, 1.0)
    rubs = level and friction > 0.0 and model != "vertical"
    aside = dragging and (turning or rubs) and members >= FEWEST and compared == 0.0
    unseen = UNSEEN.step(model, friction)
    if aside:
        unseen = LANES[model].step / min(members, LANES[model].width)
    hopping, creeping = ((HOPPING - 1.0) * unseen, seen) if aside and not turning else (0.0, 0.0)
    return _Way(turned, turned or aside, dragging, LATE, free, seen, unseen, 0.0, hopping, creeping)


def _free(scene: Scene, ball: _Ball, model: str) -> float:
    """Return from when on [s] a flat cube on level ground may slide freely; infinite if never.

    Friction stops it after v/(μ g): the ground carries its weight on average, and turns it around at first. What it
    leaves of the speed shrinks to nothing in the air alone, in drag.
    """
    launch, ground = scene.launch, scene.ground
    if model in TURNING or any(launch.orientation) or ground.normal != (0.0, 0.0, 1.0):
        return math.inf
    x, y, z = launch.velocity
    if ground.friction == 0.0 or model == "vertical" or (x == 0.0 and y == 0.0):
        return 0.0
    if not (ball.drag > 0.0 and ball.pull > 0.0):
        return math.inf
    return (math.sqrt(x * x + y * y) / ground.friction + max(0.0, z)) / ball.pull


def _stopped(scene: Scene, ball: _Ball, speed: float, h: Array) -> Flags:
    """Return where friction in drag brings what is left of the sliding to zero, while landings are at a speed [m/s].

    Below its cutoff a step takes k = h μ·drag·v/cutoff of it, v being the speed of the fall. That is stable for k < 2:
    for a whole fall if it is slow, or at its beginning, for a time 2 cutoff/(h μ·drag·g), in which friction has to take
    what the contact before left, μ ωh v/2. Either has to last UNDERFLOW steps. And k has to come to 1/2, or the
    smallest of doubles is rounded to itself.
    """
    cutoff, friction = 1e-6 * scene.cube.radius, scene.ground.friction
    pace = friction * ball.drag / cutoff
    slow = (h * pace * speed < 2.0) & (speed > UNDERFLOW * ball.pull * h)
    left, steps = 0.5 * friction * ball.omega * h * speed, 2.0 / (h * h * pace * ball.pull)
    at_first = (steps > UNDERFLOW) & (cutoff * steps > left)
    return np.asarray((slow | at_first) & (h * pace * ball.landing > 0.5))


def _run(
    scene: Scene, ball: _Ball, way: _Way, h: Array, ends: Array, compared: float, held: Array
) -> tuple[Array, Array]:
    """Return the seconds of one run, and the steps computed, shape of h each.

    Part by part, as it lands, is not compared any more, rests, or may slide freely.
    """
    rests = scene.duration - _course(ball, scene.duration).resting
    times = {ball.climb + ball.fall, compared, rests, scene.duration}
    if 0.0 < way.free < scene.duration:
        times |= {way.free + k * (scene.duration - way.free) / PARTS for k in range(PARTS)}
    seconds, steps = np.zeros(h.shape), np.zeros(h.shape)
    start, before = 0.0, _Course(speed=ball.landing)
    for end in sorted(time for time in times if 0.0 < time <= scene.duration):
        course, watched = _course(ball, end), end <= compared
        part, length = course.beyond(before), end - start
        free = np.full(h.shape, way.free == 0.0)
        if 0.0 < way.free <= start:
            free = _stopped(scene, ball, part.speed, h)
        computed, leaps = _computed(part, way, ball, h, length, free, compared if watched else 0.0)
        computed = np.fmin(computed, length / h)
        price = np.where(free, PHASED_STEP, way.unseen)
        if watched:
            skips = _skips(compared, h, free)
            idle = np.where(skips | way.falls, way.seen, way.seen * IDLE)
            price = np.where(free & skips, PHASED_STEP, idle)
        share = np.fmin(1.0, np.fmax(0.0, ends - start) / length)
        steps += share * computed
        restless = np.where(ball.omega * h > LONGEST_HELD, way.hopping, np.where(held < math.inf, 0.0, way.creeping))
        once = LEAP * leaps + way.contact * np.fmin(part.contacts, computed)
        seconds += share * (price * computed + restless * part.resting / h + once)
        start, before = end, course
    return seconds, np.fmax(1.0, steps)


def _computed(
    part: _Course, way: _Way, ball: _Ball, h: Array, length: float, free: Flags, compared: float
) -> tuple[Array, Array]:
    """Return how many steps of a part of a run are computed one by one, and how often others are taken at once.

    length [s]: of the part. free: where it slides freely. compared [s]: the horizon, if it is compared.
    """
    flying = part.climbing + part.rising + part.falling
    stepped = way.climbs * part.climbing + way.rises * part.rising + way.falls * part.falling
    late = SOON if compared > 0.0 or way.late == SOON else LATE
    plain = (stepped + part.touching + part.resting) / h + _few(part.contacts * (NEAR + late), (flying - stepped) / h)
    often = ball.omega * h > PHASE
    contact = np.where(often, part.touching / h, np.fmin(part.touching / h, PHASED_CONTACT * part.contacts))
    # At rest a step moves the cube by less than round-off would allow to skip (`fast_forward.lost`).
    freely = contact + part.resting / h + _few(part.contacts * NEAR, flying / h)
    falling = part.falling if way.falls and ball.drag > 0.0 else 0.0
    leaps = np.full(h.shape, 2 * part.contacts)
    if compared == 0.0:
        return np.where(free, freely + _few(part.contacts * PHASED_FALL, falling / h), plain), leaps
    spacing, skips = compared / SAMPLES, _skips(compared, h, free)
    freely = freely + part.falling * way.falls / spacing
    return np.where(skips, np.where(free, freely, plain), length / h), np.where(skips, length / spacing, 0.0)


def _skips(horizon: float, h: Array, free: Flags) -> Flags:
    """Return where some steps are skipped though the run is looked at wherever its reference is known."""
    return np.asarray(horizon / SAMPLES / h >= np.where(free, FEWEST_PHASED, FEWEST_BETWEEN) - 1)


def _few(most: float, steps: Array | float) -> Array:
    """Return about the lesser of two numbers of steps, smoothly: there are as many of one where the other is large."""
    return np.asarray(np.where(np.asarray(steps) > 0.0, most * steps / (most + steps), 0.0))
