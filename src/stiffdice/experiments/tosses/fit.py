"""Restitution and friction of the board: fitted on a random third of the tosses, told on the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.errors import InputError
from stiffdice.experiments.measuring import coordinates, mapped, numbers, result
from stiffdice.experiments.tosses.launches import SOURCES, Launches, launches_of, measured, tracker_of
from stiffdice.experiments.tosses.replay import (
    CONVERGED,
    MODEL,
    SCHEME,
    Errors,
    Physics,
    errors,
    faces,
    replay,
    scene_of,
    step_of,
    whole_step,
)
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.scene.tosses import Tosses

DATA = "config/measurements/tosses.h5"

# The first grid, and how often its spacing is halved about the best place.
_RESTITUTIONS = 0.04, 0.12, 0.24, 0.45
_FRICTIONS = 0.06, 0.12, 0.18, 0.27, 0.4
_SPACING, _ROUNDS = 0.04, 4
_NEAR = 9  # tried in a round, about
# Restitutions and frictions over which the loss is told.
_LANDSCAPE = tuple(np.linspace(0.02, 0.5, 9)), tuple(np.linspace(0.03, 0.39, 13))
# Steps of the fit: its errors are known to a hundredth.
_FITTED = 0.15
# An error counts up to here [sides, rad]: a toss that took another face says no more about the ground.
_CAP = 0.5
# Resamples of the bootstrap, from a seed of its own.
_RESAMPLES = 1000
INTERVAL = 2.5, 97.5


class Fit(NamedTuple):
    """restitution and friction: best, and their 95 % intervals by resampling the tosses; losses: of all tried."""

    restitution: float
    friction: float
    restitution_interval: tuple[float, float]
    friction_interval: tuple[float, float]
    loss: float
    tried: Array  # restitution and friction, shape (tried, 2)
    losses: Array  # shape (tried, toss)


def split(count: int, seed: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return a random third of so many tosses, to fit, and the others, each ascending."""
    order = np.random.default_rng(seed).permutation(count)
    third = max(1, count // 3)
    return np.sort(order[:third]), np.sort(order[third:])


def loss_of(found: Errors) -> Array:
    """Return the loss of each toss, shape (toss,): path error [sides] and orientation error [rad], each capped."""
    return np.minimum(found.path, _CAP) + np.minimum(found.orientation, _CAP)


def fit(
    tosses: Tosses,
    launches: Launches,
    scene: Scene,
    physics: Physics,
    *,
    rounds: int = _ROUNDS,
    tell: Callable[[str, float], None] = lambda *_: None,
) -> Fit:
    """Return the restitution and friction of least mean loss; the physics gives all else.

    rounds: how often the spacing of what is tried is halved about the best. tell: called with what is tried next,
    and about what part has been.
    """
    known: dict[tuple[float, float], Array] = {}

    def tried(restitution: float, friction: float) -> None:
        place = round(restitution, 6), round(friction, 6)
        if place in known or not (0 < place[0] <= 1 and place[1] >= 0):
            return
        known[place] = losses(tosses, launches, scene, physics._replace(restitution=place[0], friction=place[1]))

    def mean(place: tuple[float, float]) -> float:
        return float(known[place].mean())

    def over() -> float:
        return min(len(known) / (len(_RESTITUTIONS) * len(_FRICTIONS) + _NEAR * rounds), 1.0)

    for restitution in _RESTITUTIONS:
        tell(f"e = {restitution:g}, with any friction", over())
        for friction in _FRICTIONS:
            tried(restitution, friction)
    for halving in range(rounds):
        spacing, best, before = _SPACING / 2**halving, min(known, key=mean), None
        while best != before:
            tell(f"e = {best[0]:.3g} ± {spacing:.3g}, μ = {best[1]:.3g} ± {spacing:.3g}", over())
            for along in (-1, 0, 1):
                for across in (-1, 0, 1):
                    tried(best[0] + along * spacing, best[1] + across * spacing)
            best, before = min(known, key=mean), best
    return _best(known)


def losses(tosses: Tosses, launches: Launches, scene: Scene, physics: Physics) -> Array:
    """Return the loss of each toss replayed with this physics, shape (toss,)."""
    ours = scene_of(tosses, physics, scene)
    paths = replay(tosses, launches, ours, whole_step(tosses.rate, step_of(ours, _FITTED)))
    return loss_of(errors(tosses, paths).means(tosses))


def _best(known: dict[tuple[float, float], Array]) -> Fit:
    places, each = np.array([*known]), np.array([*known.values()])
    best = int(each.mean(axis=1).argmin())
    random = np.random.default_rng(0)
    rows = random.integers(0, each.shape[1], (_RESAMPLES, each.shape[1]))
    again = places[np.array([each[:, row].mean(axis=1).argmin() for row in rows])]
    low, high = np.percentile(again, INTERVAL, axis=0)
    ends = [(float(a), float(b)) for a, b in zip(low, high, strict=True)]
    restitution, friction = map(float, places[best])
    return Fit(restitution, friction, ends[0], ends[1], float(each[best].mean()), places, each)


def interval(values: Array) -> tuple[float, float]:
    """Return the 95 % interval of a mean over tosses, by resampling them."""
    random = np.random.default_rng(0)
    rows = random.integers(0, len(values), (_RESAMPLES, len(values)))
    with np.errstate(invalid="ignore"):
        low, high = np.percentile(values[rows].mean(axis=1), INTERVAL)
    return float(low), float(high)


class Told(NamedTuple):
    """Errors of each toss, shape (toss,): path [sides], orientation [rad], and whether the final face is right."""

    path: Array
    orientation: Array
    right: Array


def told(tosses: Tosses, launches: Launches, scene: Scene, physics: Physics, omega_h: float = CONVERGED) -> Told:
    """Return how far tosses replayed with this physics are from the measured ones, at steps of this ωh [1]."""
    ours = scene_of(tosses, physics, scene)
    step = whole_step(tosses.rate, step_of(ours, omega_h))
    means = errors(tosses, replay(tosses, launches, ours, step)).means(tosses)
    right = faces(launches, ours, step) == tosses.faces[tosses.last]
    return Told(means.path, means.orientation, right.astype(np.float64))


_FOUND = {
    "restitution": ("restitution of a flat landing, fitted", "1"),
    "restitution_low": ("restitution, lower end of its 95 % interval", "1"),
    "restitution_high": ("restitution, upper end of its 95 % interval", "1"),
    "friction": ("friction coefficient, fitted", "1"),
    "friction_low": ("friction coefficient, lower end of its 95 % interval", "1"),
    "friction_high": ("friction coefficient, upper end of its 95 % interval", "1"),
    "loss": ("mean loss of the fitted tosses", "1"),
    "path": ("path error of each toss told, mean over time, in sides", "1", "toss"),
    "orientation": ("orientation error of each toss told, mean over time", "rad", "toss"),
    "right": ("1 if the final face is right", "1", "toss"),
}


def measure(
    scene: Scene,
    *,
    data: str = DATA,
    contact_time: Sequence[float] = (0.00125, 0.0025, 0.005, 0.01, 0.02, 0.04),
    seed: int = 18,
) -> xr.Dataset:
    """Return restitution and friction, fitted for each contact time and source of launches, and the errors that stay.

    scene: gives gravity and the contact law. data: a file of tosses. contact_time [s]: of a flat landing. seed: of the
    third that is fitted; errors are of the other tosses. Dimensions source, contact_time, toss. `landscape` is the mean
    loss of the fitted tosses over restitution and friction, of launches by the first sample and at one contact time.
    Raises InputError for a file that is not one of tosses, and for a number out of range.
    """
    times = numbers("contact_time", contact_time, "s", above=0)
    tosses, unit = measured(data, scene.gravity)
    fitted, others = split(len(tosses.counts), validation.count("seed", seed, at_least=0))
    if not len(others):
        raise InputError(f"{data}: has one toss: allowed are at least two, one to fit and one to tell of")
    mine, rest = tosses.chosen(fitted), tosses.chosen(others)

    def found(source: str, contact_time: float) -> list[object]:
        best = fit(mine, launches_of(mine, source, scene.gravity), scene, Physics(contact_time=contact_time))
        physics = Physics(best.restitution, best.friction, contact_time)
        ends = best.restitution, *best.restitution_interval, best.friction, *best.friction_interval
        return [*ends, best.loss, *told(rest, launches_of(rest, source, scene.gravity), scene, physics)]

    variables = mapped(found, _FOUND, source=SOURCES, contact_time=times) | coordinates(toss=others)
    middle = times[(len(times) - 1) // 2]
    first = launches_of(mine, SOURCES[0], scene.gravity)

    def landscape(restitution: float, friction: float) -> list[object]:
        return [losses(mine, first, scene, Physics(restitution, friction, middle)).mean()]

    meaning = {"landscape": ("mean loss of the fitted tosses", "1")}
    variables |= mapped(landscape, meaning, restitution_tried=_LANDSCAPE[0], friction_tried=_LANDSCAPE[1])
    tracker = tracker_of(tosses, scene.gravity)
    start = tosses.faces[tosses.first] == tosses.faces[tosses.last]
    about = {
        "tosses": len(tosses.counts),
        "fitted": len(fitted),
        "rate": tosses.rate,
        "side": tosses.side,
        "kept_face": float(start.mean()),
        "landscape_contact_time": middle,
        **{f"unit_{name}": value for name, value in unit._asdict().items()},
        **{f"tracker_{name}": value for name, value in tracker._asdict().items()},
    }
    return result(variables, "Restitution and friction of real tosses", scene, MODEL, SCHEME, __name__, **about)
