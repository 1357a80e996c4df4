"""A pilot run: the path of a scene, and how well it is known.

The error of a run is the root mean square distance of the cube's centre from the exact path, over evenly spread times
from the launch to the end, in radii of the cube. What stands for the exact path is a run of the scheme `exact` where
that applies, else of `event` at its finest tolerance; how far that may be off, twin runs say, whose round-off and local
errors are others: with other intervals, at another tolerance. In a chaotic motion the twins part, and from then on
nobody knows the path.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stiffdice import schemes
from stiffdice.requirement import least_model
from stiffdice.scene import Scene
from stiffdice.simulate import simulate
from stiffdice.state import Array, along

# Evenly spread times after the launch at which paths are compared.
SAMPLES = 600

# The twins of a run at the finest tolerance, that tell how far it is off: tolerance, and intervals in SAMPLES.
_TWINS = {
    "exact": ((schemes.FINEST, 2), (schemes.FINEST, 3)),
    "event": ((schemes.FINEST, 2), (10 * schemes.FINEST, 1), (10 * schemes.FINEST, 3)),
}

# The path is taken to be known to so many times the largest difference of its twins.
_TWIN_FACTOR = 4

# A run of a scheme that takes its own steps is ended after so long [s].
PATIENCE = 10.0


class TooSlowError(Exception):
    """A run takes too long; fraction: of it that was done."""

    def __init__(self, fraction: float) -> None:
        self.fraction = fraction


@dataclass(frozen=True)
class Trial:
    """One run that was made: with what, what it cost, and where it went.

    steps; tolerance [1]; places [m], shape (SAMPLES + 1, 3), not-a-number after its end. evaluations of the force;
    computed: steps that were not taken at once. seconds [s]: of the call, compiled before or not.
    """

    scheme: str
    steps: int
    tolerance: float
    places: Array
    evaluations: int
    computed: int
    seconds: float


@dataclass(frozen=True)
class Pilot:
    """What a pilot run found; curves have the shape (SAMPLES + 1,), of a run that would end at each time.

    floor [1]: how far the path may be off, in radii. landings: samples at which the ground began to push the cube up.
    """

    scene: Scene
    model: str
    model_reason: str
    best: Trial
    floor: Array
    landings: npt.NDArray[np.int64]

    @property
    def times(self) -> Array:
        """The times of the samples [s]."""
        return np.arange(SAMPLES + 1) / SAMPLES * self.scene.duration

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
    scheme: str,
    steps: int,
    tolerance: float = schemes.TOLERANCE,
    budget: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Trial:
    """Return a run; steps: a multiple of SAMPLES. budget: most steps to compute one by one, where a path may end."""
    begun = time.perf_counter()
    run = simulate(
        scene,
        model=model,
        scheme=scheme,
        steps=steps,
        tolerance=tolerance,
        every=steps // SAMPLES,
        leap=True,
        budget=budget,
        progress=progress,
    )
    seconds = time.perf_counter() - begun
    places = np.full((SAMPLES + 1, 3), np.nan)
    assert run.trajectory is not None
    places[: len(run.trajectory.state)] = run.trajectory.state["position"]
    computed = int(run.steps_computed[0])
    return Trial(scheme, steps, tolerance, places, int(run.evaluations[0]), computed, seconds)


def flown(scene: Scene, patience: float = PATIENCE) -> Pilot:
    """Return the pilot of a scene; raises TooSlowError if one of its runs takes longer than `patience` [s]."""
    model, reason = least_model(scene, scene.duration / SAMPLES)
    scheme = "event" if schemes.unfit("exact", scene, model) else "exact"
    best = tried_patiently(scene, model, scheme, 1, schemes.FINEST, patience)
    twins = [tried_patiently(scene, model, scheme, many, tolerance, patience) for tolerance, many in _TWINS[scheme]]
    differences = [curve(twin.places, best.places, scene.cube.radius) for twin in twins]
    with np.errstate(invalid="ignore"):
        largest = np.maximum.accumulate(np.abs(best.places).max(axis=1)) / scene.cube.radius
        floor = _TWIN_FACTOR * np.max(differences, axis=0) + 2.0**-52 * np.maximum(1.0, largest)
    floor = np.where(np.isfinite(floor), floor, np.inf)
    return Pilot(scene, model, reason, best, floor, _landings(scene, best.places))


def tried_patiently(
    scene: Scene, model: str, scheme: str, many: int, tolerance: float, patience: float = PATIENCE
) -> Trial:
    """Return a run in so many times SAMPLES intervals; raises TooSlowError if it takes longer than `patience` [s]."""
    tried(scene, model, scheme, SAMPLES, budget=1)  # loads, or compiles: that is not what patience is for
    until = time.monotonic() + patience

    def watched(fraction: float) -> None:
        if time.monotonic() > until and fraction < 1:
            raise TooSlowError(fraction)

    return tried(scene, model, scheme, many * SAMPLES, tolerance, progress=watched)


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
