"""Whether a promise is kept: the advised run against finer ones, and against the pilot's by other methods."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stiffdice.advice.pilot import SAMPLES, curve
from stiffdice.advice.result import Advice, Option
from stiffdice.experiments.measuring import states_of
from stiffdice.integrators import registry as schemes
from stiffdice.simulation.run import Run, simulate


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
    places, radius = states_of(run, SAMPLES)["position"], advice.scene.cube.radius
    # Infinite where one ended early.
    found = [seen * float(curve(places, states_of(finer, SAMPLES)["position"], radius)[-1])]
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
