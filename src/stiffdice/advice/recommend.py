"""Advice for a scene and an error: model, scheme, steps, what they cost, and why to believe it.

The error is that of `pilot.py`. For a scheme that controls its own error the advised run is one of those that were
made: its error is measured. A scheme of fixed steps is tried with more and more of them, as far as a budget goes; what
is beyond that is extrapolated by its order under contact, which is one wherever a force sets in with a jump
(docs/method.md). A run that was ended early, or is too far off to say anything, is known until then only; from there on
its error is taken to grow as one of the pilot's tolerance does, or as the square of time if that is more.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from stiffdice.advice.pilot import PATIENCE, SAMPLES, Pilot, TooSlowError, Trial, curve, flown, tried, tried_patiently
from stiffdice.dynamics.state import Array
from stiffdice.errors import InputError
from stiffdice.integrators import linear_stability
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation.run import Run, simulate

# A run whose error is expected to be so many times smaller keeps a promise.
SAFETY = 2.0

# The same of one that is extrapolated.
_FAR_SAFETY = 3.0

# Twice the steps divide an error of second order by four; by less than this it is taken for one of first order.
_SECOND = 3.0

# Fixed steps are tried up to so many computed ones; a run of so many is timed.
BUDGET, TIMED = 200_000, 20_000

# Errors above this part of a radius do not grow as small ones do.
_LINEAR = 0.05

# Runs that an extrapolation takes the worst of: errors depend on the phase of a landing, too.
_RUNGS = 3

# A scheme that needs no choice of steps is advised unless another takes less than this part of its time.
_WORTH = 0.5

# A run that takes longer [s] is timed once; a scene that takes more force evaluations is tried at fewer tolerances.
_SLOW, _DEAR = 0.3, 1_000_000

# Past this many steps counting them is no longer exact.
_MOST_STEPS = float(validation.LARGEST_COUNT)

# Schemes that are of second order under a contact without a jump.
_SECOND_ORDER = frozenset({"velocity_verlet", "rk4"})

# What the advice was tried on (docs/advice.md): stiffness for the paper's cube, and damping ratio of a flat landing.
STUDIED_STIFFNESS = 1e2, 1e12
STUDIED_ZETA = 0.5
STUDIED_LANDINGS = 30

MEASURED, EXTRAPOLATED, THEORY = "measured", "extrapolated", "theory"


@dataclass(frozen=True)
class Option:
    """One way to compute the scene.

    scheme: of the time steps. steps: their number. tolerance [1]: of a scheme that controls its own error, else None.
    error [radii]: expected; None if nothing is known. basis: `measured`, `extrapolated` or `theory` (no run says
    anything; steps are those of the stability limit, and not enough). evaluations [1]: of the force. seconds [s]:
    about, of the time loop. omega_h [1]: of the fastest contact; None for a scheme that takes its own steps. limit [1]:
    up to which omega_h the scheme is stable. keeps: whether the error asked is expected to be kept. evidence: a
    sentence.
    """

    scheme: str
    steps: int
    tolerance: float | None
    error: float | None
    basis: str
    evaluations: float
    seconds: float
    omega_h: float | None
    limit: float | None
    keeps: bool
    evidence: str

    @property
    def margin(self) -> float | None:
        """How many times shorter than the stability limit its steps are; infinite without a limit, None if moot."""
        if self.omega_h is None or self.limit is None or self.omega_h == 0:
            return None
        return self.limit / self.omega_h


@dataclass(frozen=True)
class Advice:
    """What to do. `scene` ends at the horizon; errors and times are for runs that end there.

    scene: to compute. asked [radii]: the error. duration [s]: of the scene as given. horizon [s]: until when the error
    is promised. cut: why it is shorter than asked, or nothing. model: the least that is exact for the scene.
    model_reason: why. best: the option advised, None if none keeps the error. options: quickest first, those that keep
    the error before those that do not. floor [radii]: how well the path is known. paths: runs as good as exact, by the
    methods that are compared. landings: how many. growth [1]: of an error from after the first landing to the end, None
    with fewer than two. mode: the fastest contact. outside: where the scene is out of the studied range, a sentence
    each.
    """

    scene: Scene
    asked: float
    duration: float
    horizon: float
    cut: str
    model: str
    model_reason: str
    best: Option | None
    options: tuple[Option, ...]
    floor: float
    paths: tuple[Trial, ...]
    landings: int
    growth: float | None
    mode: str
    outside: tuple[str, ...]

    @property
    def growth_per_landing(self) -> float | None:
        """By how much a landing multiplies an error [1], on average."""
        return None if self.growth is None else self.growth ** (1 / (self.landings - 1))


@dataclass(frozen=True)
class Check:
    """A promise, and what was found: promised and found error [radii]; against: the runs that were compared with."""

    run: Run
    promised: float
    found: float
    against: str

    @property
    def kept(self) -> bool:
        """Whether the error found is at most the one promised."""
        return self.found <= self.promised


def parsed_error(text: str) -> float:
    """Return the error [radii] in a text such as 1%, 0.01 or 1e-6; raises InputError."""
    number, percent = (text.strip()[:-1], 100.0) if text.strip().endswith("%") else (text, 1.0)
    try:
        value = float(number) / percent
    except ValueError:
        value = math.nan
    if not 0 < value <= 1:
        raise InputError(
            f"--error = {text}: allowed is a part of the radius above 0, up to 1, such as 1%, 0.01 or 1e-6"
        )
    return value


def advise(
    scene: Scene,
    error: float = 0.01,
    *,
    horizon: float | None = None,
    scheme: str | None = None,
    patience: int = PATIENCE,
    budget: int = BUDGET,
    tell: Callable[[str], None] | None = None,
) -> Advice:
    """Return how to compute a scene to an error.

    scene: the problem. error [radii]: root mean square distance between the cube's centre and its exact path, over
    the time to the horizon, in radii of the cube. horizon [s]: until when the error is to be kept; None is the scene's
    duration. scheme: advice for this one alone. patience: force evaluations of the longest pilot run. budget: steps
    that a run of fixed steps may compute one by one. tell: called with what is tried next.

    Raises InputError for an unknown name, a number out of range, and a scene of which no path can be computed.
    """
    error = validation.number("error", error, "radii", above=0)
    until = scene.duration if horizon is None else validation.number("horizon", horizon, "s", above=0)
    if until > scene.duration:
        raise InputError(f"horizon = {until:g}: allowed is up to the scene's duration, {scene.duration:g} s")
    if scheme is not None:
        validation.choice("scheme", scheme, schemes.SCHEMES)
    tell = tell or (lambda text: None)
    tell("a pilot run")
    pilot, cut = _known(dataclasses.replace(scene, duration=until), error, patience)
    hardest = linear_stability.hardest(pilot.scene, pilot.model)
    kept = bool(pilot.floor[-1] <= error)
    if scheme is not None:
        schemes.check_fit(scheme, pilot.scene, pilot.model)
    names = [name for name in schemes.SCHEMES if not schemes.unfit(name, pilot.scene, pilot.model)]
    tell("event")
    ladder = [] if scheme == "exact" else _ladder(pilot, patience)
    shape = _shape(pilot, ladder)
    options = []
    for name in names if scheme is None else [scheme]:
        tell(name)
        if name == "exact":
            options.append(_exact(pilot, kept))
        elif name == "event":
            options.append(_event(pilot, ladder, error, kept, patience))
        else:
            option = _Steps(pilot, name, hardest, shape, budget).option(error)
            options.append(dataclasses.replace(option, keeps=option.keeps and kept))
    options.sort(key=lambda option: (not option.keeps, option.seconds))
    best = _best(options)
    return Advice(
        pilot.scene,
        error,
        scene.duration,
        pilot.scene.duration,
        cut,
        pilot.model,
        pilot.model_reason,
        best,
        tuple(options),
        float(pilot.floor[-1]),
        (pilot.best,) if pilot.other is None else (pilot.best, pilot.other),
        len(pilot.landings),
        _growth(pilot, shape),
        hardest.mode,
        tuple(_outside(pilot, best)),
    )


def _known(scene: Scene, error: float, patience: int) -> tuple[Pilot, str]:
    """Return a pilot of the scene until its path is not known to the error any more, and why it ends before."""
    cut = ""
    while True:
        try:
            pilot = flown(scene, patience)
        except TooSlowError as out:
            # A little shorter, as its twins take longer.
            shorter = _rounded_down(0.8 * out.fraction * scene.duration)
            cut = cut or f"a pilot run to t = {scene.duration:g} s takes more than {patience:,} force evaluations"
        else:
            known = np.flatnonzero(pilot.floor <= error)
            last = int(known[-1]) if known.size else 0
            if last == SAMPLES:
                return pilot, cut
            if last == 0:
                if not np.isfinite(pilot.floor[1]):
                    raise InputError("the motion leaves the range of doubles from the first steps on: no path to keep")
                return pilot, f"{_judge(pilot, error, 1)} the path to {pilot.floor[1]:.1g} radii only"
            shorter = _rounded_down(float(pilot.times[last]))
            cut = cut or _why_unknown(pilot, error)
        if not 0 < shorter < scene.duration:
            raise InputError(
                f"duration = {scene.duration:g}: no path is found in {patience:,} evaluations; try a --horizon [s]"
            )
        scene = dataclasses.replace(scene, duration=shorter)


def _why_unknown(pilot: Pilot, error: float) -> str:
    if not np.isfinite(pilot.floor[-1]):
        return "the motion leaves the range of doubles"
    if pilot.round_off[-1] <= error:
        return (
            f"{pilot.best.scheme} and {pilot.other_method} agree on the path until t = {pilot.scene.duration:g} s to "
            f"{pilot.floor[-1]:.1g} radii only"
        )
    return (
        f"round-off grows to {pilot.floor[-1]:.1g} radii until t = {pilot.scene.duration:g} s, over "
        f"{len(pilot.landings)} landings: no scheme in double precision knows the path to {error:g} there; a run to "
        "the end is right statistically at most"
    )


def _judge(pilot: Pilot, error: float, sample: int) -> str:
    """Return what says how well a path is known at a sample, as the subject of a sentence, and its verb."""
    by_twins = bool(pilot.round_off[sample] > error)
    return "double precision itself knows" if by_twins else f"{pilot.best.scheme} and {pilot.other_method} agree on"


def _rounded_down(seconds: float) -> float:
    """Return a time to two digits, not later."""
    if seconds <= 0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(seconds)) - 1)
    return float(f"{math.floor(seconds / unit) * unit:.2g}")


def _best(options: Sequence[Option]) -> Option | None:
    """Return the option to advise: the quickest, but one that needs no choice of steps if that is about as quick.

    An extrapolated one is advised only where none was measured.
    """
    fit = [option for option in options if option.keeps]
    fit = [option for option in fit if option.basis == MEASURED] or fit
    if not fit:
        return None
    own = [option for option in fit if option.omega_h is None]
    return own[0] if own and fit[0].seconds > _WORTH * own[0].seconds else fit[0]


def _ladder(pilot: Pilot, patience: int) -> list[tuple[Trial, Array]]:
    """Return runs of `event` from the finest tolerance on, each with its error, until one takes too long."""
    trials = [pilot.best] if pilot.best.scheme == "event" else []
    try:
        if not trials:
            trials.append(tried_patiently(pilot.scene, pilot.model, "event", 1, schemes.FINEST, patience))
        # A slow scene is tried at every fourth decade.
        for decade in range(12, 0, -1 if trials[0].evaluations < _DEAR else -4):
            tolerance = float(f"1e-{decade}")
            trials.append(tried_patiently(pilot.scene, pilot.model, "event", 1, tolerance, patience))
    except TooSlowError:
        pass
    return [(trial, pilot.error(trial)) for trial in trials]


def _shape(pilot: Pilot, ladder: Sequence[tuple[Trial, Array]]) -> Array:
    """Return how a small error grows, shape (SAMPLES + 1,), up to a factor: the largest of the ladder's that is."""
    small = [off for _, off in ladder if pilot.floor[-1] < off[-1] <= _LINEAR]
    return max(small, key=lambda off: off[-1]) if small else pilot.floor


def _exact(pilot: Pilot, kept: bool) -> Option:
    error, trial = float(pilot.floor[-1]), pilot.best
    said = f"it is exact but for round-off, which {pilot.borne_out}"
    seconds = _seconds(pilot, trial)
    return Option("exact", SAMPLES, None, error, MEASURED, trial.evaluations, seconds, None, None, kept, said)


def _event(pilot: Pilot, ladder: Sequence[tuple[Trial, Array]], error: float, kept: bool, patience: int) -> Option:
    """Return the cheapest tolerance from which on all finer ones keep an error."""
    if not ladder:
        said = f"a run takes more than {patience:,} force evaluations, a contact that lasts; none was made to the end"
        trial = tried(pilot.scene, pilot.model, "event", SAMPLES, schemes.FINEST, budget=patience)
        most, seconds = trial.evaluations, trial.seconds
        return Option("event", SAMPLES, schemes.FINEST, None, THEORY, most, seconds, None, None, False, said)
    # Where the path comes from these runs, the finest is as far off as that may be.
    errors = [max(float(off[-1]), float(pilot.floor[-1])) for _, off in ladder]
    fit = [ladder[0]]
    for trial, off in ladder[1:]:
        if not SAFETY * off[-1] + pilot.floor[-1] <= error:
            break
        fit.append((trial, off))
    k = min(range(len(fit)), key=lambda k: fit[k][0].evaluations)
    trial, kept = fit[k][0], kept and errors[k] <= error
    by = "exact" if pilot.best.scheme == "exact" else f"event at tolerance {schemes.FINEST:.0e}"
    said = f"this very run was made, and compared with {by}, which {pilot.borne_out}"
    seconds = _seconds(pilot, trial)
    return Option(
        "event", SAMPLES, trial.tolerance, errors[k], MEASURED, trial.evaluations, seconds, None, None, kept, said
    )


def _seconds(pilot: Pilot, trial: Trial) -> float:
    """Return how long a run takes [s]: the median of three more, unless it is slow."""
    if trial.seconds >= _SLOW:
        return trial.seconds
    again = [tried(pilot.scene, pilot.model, trial.scheme, trial.steps, trial.tolerance) for _ in range(3)]
    return statistics.median(each.seconds for each in again)


class _Steps:
    """A scheme of fixed steps on a pilot's scene."""

    def __init__(self, pilot: Pilot, scheme: str, hardest: linear_stability.Hardest, shape: Array, budget: int) -> None:
        self._pilot, self._scheme, self._hardest, self._shape = pilot, scheme, hardest, shape
        self._budget = budget
        self._limit = linear_stability.stability_limit(scheme, hardest.zeta)
        jumps = pilot.scene.ground.damping > 0 or pilot.scene.ground.friction > 0
        self._best_order = 2 if scheme in _SECOND_ORDER and not jumps else 1

    def option(self, error: float) -> Option:
        """Return how many steps an error takes."""
        rungs: list[tuple[Trial, Array]] = []
        keeping = 0
        for steps in self._ladder():
            trial = tried(self._pilot.scene, self._pilot.model, self._scheme, steps, budget=self._budget)
            off = self._pilot.error(trial)
            rungs.append((trial, off))
            keeping = keeping + 1 if SAFETY * off[-1] + self._pilot.floor[-1] <= error else 0
            # One that keeps it might be lucky.
            if keeping == 2 or trial.computed >= self._budget or (keeping == 0 and steps > _MOST_STEPS / 4):
                break
        if keeping == 2:
            return self._measured(*rungs[-2], error)
        return self._extrapolated(rungs, error)

    def _ladder(self) -> Iterator[int]:
        """Yield steps, twice as many every time, from where the scheme is stable on."""
        longest = min(1.0, 0.9 * self._limit) if self._limit > 0.1 else 1.0
        steps = SAMPLES * max(1, math.ceil(self._hardest.omega * self._pilot.scene.duration / longest / SAMPLES))
        while steps <= _MOST_STEPS:
            yield steps
            steps *= 2

    def _measured(self, trial: Trial, off: Array, asked: float) -> Option:
        error = max(float(off[-1]), float(self._pilot.floor[-1]))
        by = self._pilot.best.scheme
        said = f"this very run was made, flights taken at once, and compared with {by}; so was one of half the step"
        return self._told(trial.steps, error, MEASURED, trial, self._rounding(trial.steps) <= asked, said)

    def _extrapolated(self, rungs: list[tuple[Trial, Array]], error: float) -> Option:
        known = self._telling(rungs)
        last = rungs[-1][0]
        if not known:
            said = "no run within the budget says how far off it is; more steps than these, by its stability limit"
            return self._told(last.steps, None, THEORY, last, False, said)
        order = self._order(known)
        worst = max(end * float(trial.steps) ** order for trial, end in known)
        wanted = (_FAR_SAFETY * worst / error) ** (1 / order)
        steps = SAMPLES * math.ceil(max(wanted, last.steps) / SAMPLES) if wanted < _MOST_STEPS else 0
        said = (
            f"extrapolated by order {order} under contact (docs/method.md) from runs of "
            f"{known[0][0].steps:.3g} to {known[-1][0].steps:.3g} steps"
        )
        if steps == 0:
            return self._told(
                wanted, error / _FAR_SAFETY, EXTRAPOLATED, last, False, said + ": more than can be counted"
            )
        expected = worst / float(steps) ** order
        return self._told(steps, expected, EXTRAPOLATED, last, self._rounding(steps) <= error, said)

    def _rounding(self, steps: int) -> float:
        """Return what round-off may come to [radii]: half a unit of the place in each step, all in one direction."""
        pilot = self._pilot
        return steps * 2.0**-53 * float(np.nanmax(np.abs(pilot.best.places))) / pilot.scene.cube.radius

    def _order(self, known: list[tuple[Trial, float]]) -> int:
        """Return the order to extrapolate by: two only where the last runs show it."""
        ends = [end for _, end in known]
        shown = len(ends) == _RUNGS and all(a / b > _SECOND for a, b in itertools.pairwise(ends) if b > 0)
        return self._best_order if shown else 1

    def _telling(self, rungs: list[tuple[Trial, Array]]) -> list[tuple[Trial, float]]:
        """Return some runs with their errors at the end [radii], by their steps.

        They are the finest of those that are known to the end; if there is none, of those that are known longest.
        """
        grown = [(trial, self._grown(off)) for trial, off in rungs]
        known = [(trial, *found) for trial, found in grown if found is not None]
        whole = [each for each in known if each[1] == SAMPLES]
        longest = whole or sorted(known, key=lambda each: (each[1], each[0].steps))
        return sorted(((trial, end) for trial, _, end in longest[-_RUNGS:]), key=lambda each: each[0].steps)

    def _grown(self, off: Array) -> tuple[int, float] | None:
        """Return until which sample a run is known, and its error at the end [radii]; None if it says nothing."""
        small = np.flatnonzero((off <= _LINEAR) & (off > 0) & (self._shape > 0))
        if not small.size:
            return None
        last = int(small[-1])
        if last == SAMPLES:
            return last, float(off[-1])
        landed = self._pilot.landings
        # Until the second landing a chaotic motion has not shown how errors grow.
        if len(landed) and last <= landed[0]:
            return None
        # What a scheme does to every bounce adds up in the speed, and so twice in the place, where nothing is chaotic.
        grown = float(off[last] * max((SAMPLES / last) ** 2, self._shape[-1] / self._shape[last]))
        return (last, grown) if math.isfinite(grown) else None

    def _told(self, steps: float, error: float | None, basis: str, trial: Trial, keeps: bool, evidence: str) -> Option:
        stages = trial.evaluations / max(1, trial.computed)
        pilot = self._pilot
        if steps < _MOST_STEPS and not keeps and error is not None:
            evidence += f"; round-off of so many steps may come to {self._rounding(int(steps)):.1g} radii"
        return Option(
            self._scheme,
            int(steps) if steps < _MOST_STEPS else validation.LARGEST_COUNT,
            None,
            error,
            basis,
            stages * steps,
            steps * _seconds_per_step(pilot.scene, pilot.model, self._scheme, trial.steps),
            self._hardest.omega * pilot.scene.duration / steps,
            self._limit,
            keeps,
            evidence,
        )


def _seconds_per_step(scene: Scene, model: str, scheme: str, steps: int) -> float:
    """Return how long a step takes [s], of plain stepping: the median of three runs."""
    took = []
    for _ in range(3):
        begun = time.perf_counter()
        run = simulate(scene, model=model, scheme=scheme, steps=steps, every=steps // SAMPLES, budget=TIMED)
        took.append((time.perf_counter() - begun) / max(1, int(run.steps_computed[0])))
    return statistics.median(took)


def _growth(pilot: Pilot, shape: Array) -> float | None:
    """Return by how much an error grows from the second landing to the end; a first one is needed to make it."""
    if len(pilot.landings) < 2:
        return None
    start = float(shape[min(SAMPLES, int(pilot.landings[1]))])
    return max(1.0, float(shape[-1]) / start) if start > 0 and math.isfinite(float(shape[-1])) else None


def _outside(pilot: Pilot, best: Option | None) -> Iterator[str]:
    """Yield what about a scene the advice was not tried on."""
    scene = pilot.scene
    ground, cube = scene.ground, scene.cube
    if pilot.model == "flying":
        return
    if scene.gravity == 0:
        yield "gravity = 0: tried under gravity only"
    else:
        unit = cube.mass * scene.gravity / 9.8 / cube.radius
        low, high = (bound * unit for bound in STUDIED_STIFFNESS)
        if not low * (1 - 1e-9) <= ground.stiffness <= high * (1 + 1e-9):
            yield f"ground.stiffness = {ground.stiffness:g}: tried from {low:.3g} to {high:.3g} kg/s² for such a cube"
    zeta = ground.damping / math.sqrt(ground.stiffness) / math.sqrt(cube.mass) if ground.stiffness > 0 else math.inf
    if ground.damping > 0 and zeta > STUDIED_ZETA:
        yield f"ground.damping = {ground.damping:g}: a damping ratio of {zeta:.3g}; tried up to {STUDIED_ZETA:g}"
    if ground.contact != "gated":
        yield f"ground.contact = {ground.contact}: the study of work and precision has the gated law only"
    if ground.normal != (0.0, 0.0, 1.0):
        yield "ground.normal: the study of work and precision has level ground only"
    if len(pilot.landings) > STUDIED_LANDINGS:
        yield f"{len(pilot.landings)} landings: tried up to {STUDIED_LANDINGS}"
    if best is not None and best.omega_h is not None and best.omega_h > 1:
        yield f"ωh = {best.omega_h:.3g}: tried up to 1"


def run_advised(advice: Advice, option: Option, progress: Callable[[float], None] | None = None) -> Run:
    """Return the run of an option, with its trajectory: up to 10,000 states.

    advice: what `advise` returned. option: one of its options. progress: called with the fraction done, some times a
    second.

    Raises InputError where the option cannot be run, as `simulate` does.
    """
    return _run(advice, option.scheme, option.steps, option.tolerance, progress)


def check(advice: Advice, run: Run, progress: Callable[[float], None] | None = None) -> Check:
    """Compare a run of the advised scene with one of about twice the cost, and with the pilot's by other methods.

    A scheme of fixed steps is run at half the step: of a first-order error that shows one half, which is made good.
    Raises InputError for a run without a trajectory at the samples.
    """
    if run.scheme == "event":
        finer, against = _finer(advice, run, progress)
    else:
        finer = _run(advice, run.scheme, 2 * run.steps, None, progress)
        against = f"{run.scheme} with {2 * run.steps:,} steps"
    seen = 1.0 if run.scheme in ("event", "exact") else 2.0
    places, radius = _places(run), advice.scene.cube.radius
    found = [seen * float(curve(places, _places(finer), radius)[-1])]  # infinite where one ended early
    for path in advice.paths:
        if path.scheme != run.scheme:
            found.append(float(curve(places, path.places, radius)[-1]))
            against += f", and {path.scheme} at tolerance {path.tolerance:.0e}"
    return Check(run, advice.asked, max(found), against)


def _finer(advice: Advice, run: Run, progress: Callable[[float], None] | None) -> tuple[Run, str]:
    """Return a run of `event` of at least twice the evaluations, or the finest; and how to call it."""
    tolerance, many, cost = run.tolerance, 1, 0.0
    while cost < 2 and many == 1:
        # Below the finest tolerance only more intervals make another run.
        many = 2 if tolerance <= schemes.FINEST else 1
        tolerance = max(schemes.FINEST, tolerance / 10)
        finer = _run(advice, run.scheme, many * run.steps, tolerance, progress)
        cost = int(finer.evaluations[0]) / max(1, int(run.evaluations[0]))
    intervals = "" if many == 1 else " in twice the intervals, the finest there is"
    return finer, f"event at tolerance {tolerance:.0e}{intervals}, {cost:.2g} times the evaluations"


def _run(
    advice: Advice, scheme: str, steps: int, tolerance: float | None, progress: Callable[[float], None] | None
) -> Run:
    return simulate(
        advice.scene,
        model=advice.model,
        scheme=scheme,
        steps=steps,
        tolerance=schemes.TOLERANCE if tolerance is None else tolerance,
        every=every_of(steps),
        progress=progress,
    )


def every_of(steps: int) -> int:
    """Return the K that keeps the samples' times, and as many states between them as come to 10,000 at most."""
    between = steps // SAMPLES
    return between // max(part for part in range(1, 17) if between % part == 0)


def _places(run: Run) -> Array:
    """Return the places at the samples [m], shape (SAMPLES + 1, 3), not-a-number after the run's end."""
    if run.trajectory is None:
        raise InputError("a run is compared by its trajectory, which was not kept")
    places = np.full((SAMPLES + 1, 3), np.nan)
    kept = run.trajectory.state["position"][run.trajectory.step % (run.steps // SAMPLES) == 0]
    places[: len(kept)] = kept
    return places
