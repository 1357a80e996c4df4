"""What `advise` returns: options, and the one to take; and whether its promise is kept.

The advised run is compared with finer ones, and with the pilot's by other methods.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stiffdice.advice.pilot import SAMPLES, Trial, curve
from stiffdice.experiments.measuring import states_of
from stiffdice.integrators import registry as schemes
from stiffdice.scene.scene import Scene
from stiffdice.simulation.run import Run, simulate

MEASURED, EXTRAPOLATED, THEORY = "measured", "extrapolated", "theory"


@dataclass(frozen=True)
class Option:
    """One way to compute the scene.

    scheme: of the time steps. steps: their number. tolerance [1]: of a scheme that controls its own error, else None.
    error [radii]: expected; None if nothing is known. basis: `measured`, `extrapolated` or `theory` (no run says
    anything; steps are those of the stability limit, and not enough). evaluations [1]: of the force. seconds [s]:
    about, of the time loop. omega_h [1]: of the fastest contact; None for a scheme that takes its own steps. limit [1]:
    up to which omega_h the scheme is stable. keeps: whether the requested error is expected to be met. evidence: a
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

    promised: float
    found: float
    against: str

    @property
    def kept(self) -> bool:
        """Whether the error found is at most the one promised."""
        return self.found <= self.promised


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
    tolerance, many, cost = run.tolerance, 1, 0.0
    if run.scheme != "event":
        finer = _run(advice, run.scheme, 2 * run.steps, None, progress)
        against = f"{run.scheme} with {2 * run.steps:,} steps"
    while run.scheme == "event" and cost < 2 and many == 1:
        # Below the finest tolerance only more intervals make another run.
        many = 2 if tolerance <= schemes.FINEST else 1
        tolerance = max(schemes.FINEST, tolerance / 10)
        finer = _run(advice, run.scheme, many * run.steps, tolerance, progress)
        cost = int(finer.evaluations[0]) / max(1, int(run.evaluations[0]))
        intervals = "" if many == 1 else " in twice the intervals, the finest there is"
        against = f"event at tolerance {tolerance:.0e}{intervals}, {cost:.2g} times the evaluations"
    seen = 1.0 if run.scheme in ("event", "exact") else 2.0
    places, radius = states_of(run, SAMPLES)["position"], advice.scene.cube.radius
    # Infinite where one ended early.
    found = [seen * float(curve(places, states_of(finer, SAMPLES)["position"], radius)[-1])]
    for path in advice.paths:
        if path.scheme != run.scheme:
            found.append(float(curve(places, path.places, radius)[-1]))
            against += f", and {path.scheme} at tolerance {path.tolerance:.0e}"
    return Check(advice.asked, max(found), against)


def _run(
    advice: Advice, scheme: str, steps: int, tolerance: float | None, progress: Callable[[float], None] | None
) -> Run:
    """Return a run that keeps the samples' times, and as many states between them as come to 10,000 at most."""
    between = steps // SAMPLES
    return simulate(
        advice.scene,
        model=advice.model,
        scheme=scheme,
        steps=steps,
        tolerance=schemes.TOLERANCE if tolerance is None else tolerance,
        every=between // max(part for part in range(1, 17) if between % part == 0),
        progress=progress,
    )
