"""A pilot run: the path of a scene, and how well it is known.

The error of a run is the root mean square distance of the cube's centre from the exact path, over evenly spread times
from the launch to the end, in radii of the cube. What stands for the exact path is a run of the scheme `exact` where
that applies, else of `event` at its finest tolerance. How far that may be off, twin runs say, whose round-off and local
errors are others: with other intervals, at another tolerance; and a run by another method, which shares no error with
it: `event` beside `exact`, SciPy's LSODA beside `event`. In a chaotic motion the twins part, and from then on nobody
knows the path.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.model_selection import least_model
from stiffdice.dynamics.state import Array
from stiffdice.experiments.measuring import states_of
from stiffdice.integrators import registry as schemes
from stiffdice.scene.rotation import along
from stiffdice.scene.scene import Scene
from stiffdice.simulation.backend import OURS
from stiffdice.simulation.run import simulate

# Evenly spread times after the launch at which paths are compared.
SAMPLES = 600

# The twins of a run at the finest tolerance, that tell how far it is off: tolerance, and intervals in SAMPLES.
_TWINS = {
    "exact": ((schemes.FINEST, 2), (schemes.FINEST, 3)),
    "event": ((schemes.FINEST, 2), (10 * schemes.FINEST, 1), (10 * schemes.FINEST, 3)),
}

# A run whose error is expected to be so many times smaller keeps a promise.
SAFETY = 2.0

# The path is taken to be known to so many times the largest difference of its twins.
_TWIN_FACTOR = 4

# And to so many times its difference from the run by another method.
_OTHER_FACTOR = 2

# A run of a scheme that takes its own steps is ended after so many force evaluations, about a second; all that `advise`
# does takes about ten.
PATIENCE = 3_000_000

# An evaluation by LSODA takes as long as so many of ours.
_DEARER = 5

# The method beside each that stands for the exact path: its name, who makes the run, and its scheme.
_OTHERS = {"exact": ("event", OURS, "event"), "event": ("SciPy's LSODA", "scipy", None)}


class TooSlowError(Exception):
    """A run takes too long; its argument is the fraction of it that was done."""


@dataclass(frozen=True)
class Trial:
    """One run that was made: with what, what it cost, and where it went.

    steps; tolerance [1]; places [m], shape (SAMPLES + 1, 3), not-a-number after its end. evaluations of the force;
    computed: steps that were not taken at once. seconds [s]: of the call, compiled before or not. fraction: how much of
    the run there is, 1 unless its budget was spent.
    """

    scheme: str
    steps: int
    tolerance: float
    places: Array
    evaluations: int
    computed: int
    seconds: float
    fraction: float


@dataclass(frozen=True)
class Pilot:
    """What a pilot run found; curves have the shape (SAMPLES + 1,), of a run that would end at each time.

    floor [1]: how far the path may be off, in radii; round_off [1]: as the twins of the same method tell it. other: the
    run by another method, None if it took too long; other_method: its name, or why there is none. landings:
    samples at which the ground began to push the cube up.
    """

    scene: Scene
    model: str
    model_reason: str
    best: Trial
    floor: Array
    round_off: Array
    other: Trial | None
    other_method: str
    landings: npt.NDArray[np.int64]

    @property
    def borne_out(self) -> str:
        """What bears the path out, and to how many radii."""
        twins, known = "twin runs (other intervals and tolerances)", f"bear out to {self.floor[-1]:.1g} radii"
        if self.other is None:
            return f"{twins} {known}; by no second method: {self.other_method}"
        return f"{twins} and {self.other_method} {known}"

    def error(self, trial: Trial) -> Array:
        """Return how far a run is off this path, in radii, if it ended at each sample; infinite where it has none."""
        return curve(trial.places, self.best.places, self.scene.cube.radius)


def curve(places: Array, others: Array, radius: float) -> Array:
    """Return the root mean square distance from the launch to each sample [radii], shape (SAMPLES + 1,)."""
    with np.errstate(all="ignore"):
        squares = ((places - others) ** 2).sum(axis=1) / radius**2
        result: Array = np.sqrt(np.cumsum(squares) / np.arange(1, len(squares) + 1))
    return np.where(np.isfinite(result), result, np.inf)


def tried(
    scene: Scene,
    model: str,
    scheme: str | None,
    steps: int,
    tolerance: float = schemes.TOLERANCE,
    budget: int | None = None,
    simulator: str = OURS,
) -> Trial:
    """Return a run; steps: a multiple of SAMPLES. budget: as `simulate`'s, where a path may end.

    scheme: None takes the simulator's own.
    """
    begun, fractions = time.perf_counter(), [1.0]
    run = simulate(
        scene,
        model=model,
        simulator=simulator,
        scheme=scheme,
        steps=steps,
        tolerance=tolerance,
        every=steps // SAMPLES,
        leap=True,
        budget=budget,
        progress=fractions.append,
    )
    seconds = time.perf_counter() - begun
    counts = int(run.evaluations[0]), int(run.steps_computed[0])
    whole = run.steps_done[0] == steps or run.measures["out_of_range"][0] > 0
    fraction = 1.0 if whole else fractions[-1]
    return Trial(run.scheme, steps, tolerance, states_of(run, SAMPLES)["position"], *counts, seconds, fraction)


def flown(scene: Scene, patience: int = PATIENCE) -> Pilot:
    """Return the pilot of a scene; raises TooSlowError if one of its runs takes more evaluations than `patience`."""
    model, reason = least_model(scene, scene.duration / SAMPLES)
    scheme = "event" if schemes.unfit("exact", scene, model) else "exact"
    best = tried_patiently(scene, model, scheme, 1, schemes.FINEST, patience)
    twins = [tried_patiently(scene, model, scheme, many, tolerance, patience) for tolerance, many in _TWINS[scheme]]
    differences = [curve(twin.places, best.places, scene.cube.radius) for twin in twins]
    with np.errstate(invalid="ignore"):
        largest = np.maximum.accumulate(np.abs(best.places).max(axis=1)) / scene.cube.radius
        round_off = _TWIN_FACTOR * np.max(differences, axis=0) + 2.0**-52 * np.maximum(1.0, largest)
    round_off = np.where(np.isfinite(round_off), round_off, np.inf)
    other, called = _by_another_method(scene, model, scheme, patience)
    floor = round_off
    if other is not None:
        floor = np.maximum(floor, _OTHER_FACTOR * curve(other.places, best.places, scene.cube.radius))
    return Pilot(scene, model, reason, best, floor, round_off, other, called, _landings(scene, best.places))


def _by_another_method(scene: Scene, model: str, scheme: str, patience: int) -> tuple[Trial | None, str]:
    """Return a run by another method than `scheme`, and its name; or none, and why."""
    name, simulator, other = _OTHERS[scheme]
    most = patience if simulator == OURS else patience // _DEARER
    trial = tried(scene, model, other, SAMPLES, schemes.FINEST, most, simulator)
    if trial.fraction < 1:
        return None, f"{name} takes more than {most:,} force evaluations"
    if not np.isfinite(trial.places).all():
        return None, f"{name} fails"
    return trial, name


def tried_patiently(
    scene: Scene, model: str, scheme: str, many: int, tolerance: float, patience: int = PATIENCE
) -> Trial:
    """Return a run in so many times SAMPLES intervals; raises TooSlowError after `patience` force evaluations."""
    tried(scene, model, scheme, SAMPLES, budget=1)  # loads, or compiles: that is no part of the time it takes
    trial = tried(scene, model, scheme, many * SAMPLES, tolerance, patience)
    if trial.fraction < 1:
        raise TooSlowError(trial.fraction)
    return trial


def _landings(scene: Scene, places: Array) -> npt.NDArray[np.int64]:
    """Return the samples at which the ground begins to push the cube up harder than it falls, shape (landing,).

    Seen between samples: bounces less than two of them apart count as one.
    """
    heights = along(places, scene.ground.normal)
    fall = scene.gravity * max(scene.ground.normal[2], 0.0) * (scene.duration / SAMPLES) ** 2
    lifts = np.diff(heights, 2)
    small = 1e-9 * np.nanmax(np.abs(heights)) if np.isfinite(heights).any() else 0.0
    pushed = lifts > max(fall, small)
    return np.flatnonzero(pushed & ~np.concatenate([[False], pushed[:-1]])) + 1
