"""Error of the simulation against reality over the number of steps: where time steps matter, and where only physics."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.experiments.measuring import coordinates, mapped, numbers, quantity, result, span
from stiffdice.experiments.tosses.fit import DATA, INTERVAL, split
from stiffdice.experiments.tosses.launches import Launches, launches_of, measured
from stiffdice.experiments.tosses.replay import (
    MODEL,
    SCHEME,
    Paths,
    Physics,
    errors,
    faces,
    replay,
    scene_of,
    step_of,
)
from stiffdice.integrators.linear_stability import fewest_steps
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.scene.tosses import Tosses

Faces = npt.NDArray[np.int8]

# What is compared with reality: the mean over time of both errors, and the face in the end.
CRITERIA = ("path", "orientation", "face")
# The floor: a scheme whose error this tolerance sets, in place of steps.
_EXACT, _TOLERANCE = "event", 1e-8
# A curve has left its floor where it is higher by this part of it, or fewer faces are right.
LEFT = 0.05
_RESAMPLES = 300

_FOUND = {
    "path": ("path error of each toss, mean over time, in sides", "1", "toss"),
    "orientation": ("orientation error of each toss, mean over time", "rad", "toss"),
    "wrong": ("1 if the final face is wrong", "1", "toss"),
    "path_numerical": ("distance from the same model without steps, mean over time, in sides", "1", "toss"),
    "orientation_numerical": ("angle from the same model without steps, mean over time", "rad", "toss"),
    "face_numerical": ("1 if the final face is another than that of the shortest steps", "1", "toss"),
}


def measure(
    scene: Scene,
    *,
    data: str = DATA,
    restitution: float = 0.125,
    friction: float = 0.18,
    contact_time: Sequence[float] = (0.0025, 0.005, 0.01),
    omega_h: Sequence[float] = (0.02, 8.0),
    count: int = 54,
    source: str = "sample",
    seed: int = 18,
) -> xr.Dataset:
    """Return errors against reality, and against the same model without steps, over ωh.

    scene: gives gravity and the contact law. data: a file of tosses. restitution, friction, contact_time [s]: of the
    board. omega_h: ends of the scan, `count` values evenly in their logarithm. source: of the launches, as of `toss`.
    seed: of the third that was fitted, and is left out. Dimensions contact_time, omega_h, toss. `floor_…` are those of
    the scheme `event`; of the face that of the shortest steps. `left` is the ωh up to which the mean over tosses is
    within 5 % of its floor, or as many right faces, by criterion, with its 95 % interval by resampling tosses.
    Raises InputError as `fit.measure` does.
    """
    low, high = span(omega_h)
    times = numbers("contact_time", contact_time, "s", above=0)
    scan = np.geomspace(low, high, validation.count("count", count, at_least=2))
    tosses, _ = measured(data, scene.gravity)
    _, others = split(len(tosses.counts), validation.count("seed", seed, at_least=0))
    rest = tosses.chosen(others)
    launches = launches_of(rest, source, scene.gravity)
    scenes = {time: scene_of(rest, Physics(restitution, friction, time), scene) for time in times}
    exact = {
        time: replay(rest, launches, ours, 1 / rest.rate, scheme=_EXACT, tolerance=_TOLERANCE)
        for time, ours in scenes.items()
    }
    settled = {time: faces(launches, ours, step_of(ours, low)) for time, ours in scenes.items()}

    def off(time: float, value: float) -> list[Array]:
        return _off(rest, launches, scenes[time], value, exact[time], settled[time])

    variables = mapped(off, _FOUND, contact_time=times, omega_h=scan) | coordinates(toss=others, criterion=CRITERIA)
    floors = np.array([_floor(rest, exact[time], settled[time]) for time in times])
    variables["floor"] = quantity(
        ("contact_time", "criterion", "toss"), floors, "error against reality without steps: sides, rad, 1 if wrong"
    )
    curves = np.stack([variables[name][1] for name in ("path", "orientation", "wrong")], axis=1)
    triples = [zip(CRITERIA, *both, strict=True) for both in zip(curves, floors, strict=True)]
    ends = np.array([[_left(scan, *triple) for triple in each] for each in triples])
    for k, name in enumerate(("left", "left_low", "left_high")):
        variables[name] = quantity(
            ("contact_time", "criterion"), ends[..., k], "omega h up to which the error is within 5 % of its floor"
        )
    limits = [step / step_of(ours, 1.0) for ours in scenes.values() for step in [_longest(ours)]]
    variables["stability_limit"] = quantity("contact_time", limits, "omega h at which the fastest contact is unstable")
    rates = [step_of(ours, 1.0) ** -1 for ours in scenes.values()]
    variables["contact_frequency"] = quantity("contact_time", rates, "omega of a flat landing", "rad s-1")
    about = {"side": rest.side, "rate": rest.rate, "restitution": restitution, "friction": friction, "source": source}
    return result(variables, "Error against reality over steps", scene, MODEL, SCHEME, __name__, **about)


def _off(tosses: Tosses, launches: Launches, scene: Scene, omega_h: float, exact: Paths, settled: Faces) -> list[Array]:
    step = step_of(scene, omega_h)
    paths = replay(tosses, launches, scene, step)
    against, numerical = errors(tosses, paths).means(tosses), errors(tosses, paths, exact).means(tosses)
    face = faces(launches, scene, step)
    wrong, other = face != tosses.faces[tosses.last], face != settled
    return [*against, wrong.astype(float), *numerical, other.astype(float)]


def _floor(tosses: Tosses, exact: Paths, settled: Faces) -> list[Array]:
    wrong = settled != tosses.faces[tosses.last]
    return [*errors(tosses, exact).means(tosses), wrong.astype(float)]


def near_floor(criterion: str, floor: float) -> float:
    """Return the error up to which a curve is near its floor: 5 % more, or 5 % fewer right faces."""
    return floor + LEFT * (1 - floor if criterion == "face" else floor)


def _left(scan: Array, criterion: str, curve: Array, floor: Array) -> tuple[float, float, float]:
    """Return the ωh from which on the mean of a curve, shape (scan, toss), is near its floor's; and its interval."""
    random = np.random.default_rng(0)
    rows = random.integers(0, len(floor), (_RESAMPLES, len(floor)))
    with np.errstate(invalid="ignore"):
        bounds = [near_floor(criterion, float(floor[row].mean())) for row in rows]
        drawn = [_edge(scan, curve[:, row].mean(axis=1), bound) for row, bound in zip(rows, bounds, strict=True)]
    low, high = np.nanpercentile(drawn, INTERVAL)
    return _edge(scan, curve.mean(axis=1), near_floor(criterion, float(floor.mean()))), float(low), float(high)


def _edge(scan: Array, means: Array, bound: float) -> float:
    """Return the ωh, half-way in the logarithm, between the last that is within a bound and the first that is not."""
    near = means <= bound
    first = len(near) if near.all() else int(near.argmin())
    if first in {0, len(near)}:
        return math.nan if first == 0 else float(scan[-1])
    return math.sqrt(scan[first - 1] * scan[first])


def _longest(scene: Scene) -> float:
    """Return the longest step [s] at which the fastest contact of the cube on the board is linearly stable."""
    contact, _ = fewest_steps(scene, MODEL, SCHEME)
    return scene.duration / contact
