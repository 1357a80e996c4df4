"""Advice for a scene and an error: model, scheme, steps, what they cost, and why to believe it.

The error is that of `pilot.py`. For a scheme that controls its own error the advised run is one of those that were
made: its error is measured. Schemes of fixed steps are in `fixed_steps.py`.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import statistics
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from stiffdice.advice.fixed_steps import BUDGET, LINEAR, Search
from stiffdice.advice.pilot import PATIENCE, SAFETY, SAMPLES, Pilot, TooSlowError, Trial, flown, tried, tried_patiently
from stiffdice.advice.result import MEASURED, THEORY, Advice, Option
from stiffdice.dynamics.state import Array
from stiffdice.errors import InputError
from stiffdice.integrators import linear_stability
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene

# A scheme that needs no choice of steps is advised unless another takes less than this part of its time.
_WORTH = 0.5

# A run that takes longer [s] is timed once; a scene that takes more force evaluations is tried at fewer tolerances.
_SLOW, _DEAR = 0.3, 1_000_000

# Parts of the time that are over after the pilot run and after those of `event`, as on the scenes of the paper.
_PILOT, _LADDER = 0.27, 0.42

# Schemes that take steps of their own, so that the advised run is one that was made.
_OWN = ("exact", "event")

# What the advice was tried on (docs/how-to/advice.md): stiffness for the paper's cube, and damping ratio of a flat
# landing.
STUDIED_STIFFNESS = 1e2, 1e12
STUDIED_ZETA = 0.5
STUDIED_LANDINGS = 30


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
    tell: Callable[..., None] | None = None,
) -> Advice:
    """Return how to compute a scene to an error.

    scene: the problem. error [radii]: root mean square distance between the cube's centre and its exact path, over
    the time to the horizon, in radii of the cube. horizon [s]: until when the error is to hold; None is the scene's
    duration. scheme: advice for this one alone. patience: force evaluations of the longest pilot run. budget: steps
    that a run of fixed steps may compute one by one. tell: called with the name of what is tried next, and the part
    of the time that is over then.

    Raises InputError for an unknown name, a number out of range, and a scene of which no path can be computed.
    """
    error = validation.number("error", error, "radii", above=0)
    until = scene.duration if horizon is None else validation.number("horizon", horizon, "s", above=0)
    if until > scene.duration:
        raise InputError(f"horizon = {until:g}: allowed is up to the scene's duration, {scene.duration:g} s")
    if scheme is not None:
        validation.choice("scheme", scheme, schemes.SCHEMES)
    tell = tell or (lambda text, over: None)
    tell("a pilot run", 0.0)
    pilot, cut = _known(dataclasses.replace(scene, duration=until), error, patience)
    if scheme is not None:
        schemes.check_fit(scheme, pilot.scene, pilot.model)
    tell("event", _PILOT)
    ladder = [] if scheme == "exact" else _ladder(pilot, patience)
    small = [off for _, off in ladder if pilot.floor[-1] < off[-1] <= LINEAR]
    shape = max(small, key=lambda off: off[-1], default=pilot.floor)  # the largest error that grows as small ones do
    search = Search(pilot, linear_stability.hardest(pilot.scene, pilot.model), shape, budget)
    names = [scheme] if scheme else [s for s in schemes.SCHEMES if not schemes.unfit(s, pilot.scene, pilot.model)]
    options = []
    for number, name in enumerate(names):
        tell(name, _LADDER + (1 - _LADDER) * number / len(names))
        options.append(_own(pilot, name, ladder, error, patience) if name in _OWN else search.option(name, error))
    options.sort(key=lambda option: (not option.keeps, option.seconds))
    best = _best(options)
    start, end = float(shape[pilot.landings[1]]) if len(pilot.landings) > 1 else 0.0, float(shape[-1])
    return Advice(
        scene=pilot.scene,
        asked=error,
        duration=scene.duration,
        horizon=pilot.scene.duration,
        cut=cut,
        model=pilot.model,
        model_reason=pilot.model_reason,
        best=best,
        options=tuple(options),
        floor=float(pilot.floor[-1]),
        paths=(pilot.best,) if pilot.other is None else (pilot.best, pilot.other),
        landings=len(pilot.landings),
        growth=max(1.0, end / start) if start > 0 and math.isfinite(end) else None,
        mode=search.hardest.mode,
        outside=tuple(_outside(pilot, best)),
    )


def _known(scene: Scene, error: float, patience: int) -> tuple[Pilot, str]:
    """Return a pilot of the scene until its path is not known to the error any more, and why it ends before."""
    cut = ""
    while True:
        try:
            pilot = flown(scene, patience)
        except TooSlowError as out:
            # A little shorter, as its twins take longer.
            shorter = _rounded_down(0.8 * out.args[0] * scene.duration)
            cut = cut or f"a pilot run to t = {scene.duration:g} s takes more than {patience:,} force evaluations"
        else:
            last = int(np.flatnonzero(pilot.floor <= error).max(initial=0))
            if last == SAMPLES:
                return pilot, cut
            if last == 0:
                if not np.isfinite(pilot.floor[1]):
                    raise InputError("the motion leaves the range of doubles from the first steps on: no path to keep")
                return pilot, f"{_judges(pilot, error, 1)} the path to {pilot.floor[1]:.1g} radii only"
            shorter = _rounded_down(last / SAMPLES * scene.duration)
            cut = cut or _why_unknown(pilot, error)
        if not 0 < shorter < scene.duration:
            raise InputError(
                f"duration = {scene.duration:g}: no path is found in {patience:,} evaluations; try a --horizon [s]"
            )
        scene = dataclasses.replace(scene, duration=shorter)


def _why_unknown(pilot: Pilot, error: float) -> str:
    floor, end = f"{pilot.floor[-1]:.1g} radii", f"t = {pilot.scene.duration:g} s"
    if not np.isfinite(pilot.floor[-1]):
        return "the motion leaves the range of doubles"
    if pilot.round_off[-1] <= error:
        return f"{_judges(pilot, error, -1)} the path until {end} to {floor} only"
    return (
        f"round-off grows to {floor} until {end}, over {len(pilot.landings)} landings: no scheme in double precision "
        f"knows the path to {error:g} there; a run to the end is right statistically at most"
    )


def _judges(pilot: Pilot, error: float, sample: int) -> str:
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


def _own(pilot: Pilot, scheme: str, ladder: Sequence[tuple[Trial, Array]], error: float, patience: int) -> Option:
    """Return `exact`, or the cheapest tolerance of `event` from which on all finer ones keep an error."""
    if scheme == "exact":
        evidence = f"it is exact but for round-off, which {pilot.borne_out}"
        return _made_again(pilot, pilot.best, None, float(pilot.floor[-1]), error, evidence)
    if not ladder:
        trial = tried(pilot.scene, pilot.model, "event", SAMPLES, schemes.FINEST, budget=patience)
        evidence = (
            f"a run takes more than {patience:,} force evaluations, a contact that lasts; none was made to the end"
        )
        return _made_again(pilot, trial, schemes.FINEST, None, error, evidence)
    fit = itertools.takewhile(lambda each: SAFETY * each[1][-1] + pilot.floor[-1] <= error, ladder[1:])
    trial, off = min([ladder[0], *fit], key=lambda each: each[0].evaluations)
    # Where the path comes from these runs, the finest is as far off as that may be.
    expected = max(float(off[-1]), float(pilot.floor[-1]))
    by = "exact" if pilot.best.scheme == "exact" else f"event at tolerance {schemes.FINEST:.0e}"
    evidence = f"this very run was made, and compared with {by}, which {pilot.borne_out}"
    return _made_again(pilot, trial, trial.tolerance, expected, error, evidence)


def _made_again(
    pilot: Pilot, trial: Trial, tolerance: float | None, expected: float | None, error: float, evidence: str
) -> Option:
    """Return the option to make a trial again, of a scheme that takes its own steps; expected: its error, if known.

    The time is the median of three more, unless that is slow.
    """
    seconds = trial.seconds
    if seconds < _SLOW and trial.fraction == 1:
        again = [tried(pilot.scene, pilot.model, trial.scheme, trial.steps, trial.tolerance) for _ in range(3)]
        seconds = statistics.median(each.seconds for each in again)
    return Option(
        scheme=trial.scheme,
        steps=SAMPLES,
        tolerance=tolerance,
        error=expected,
        basis=THEORY if expected is None else MEASURED,
        evaluations=trial.evaluations,
        seconds=seconds,
        omega_h=None,
        limit=None,
        keeps=expected is not None and expected <= error,
        evidence=evidence,
    )


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
