"""What each piece of the model is worth against reality: the tosses replayed without it, or with another instead."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.experiments.measuring import coordinates, quantity, result
from stiffdice.experiments.tosses.fit import DATA, split
from stiffdice.experiments.tosses.launches import launches_of, measured
from stiffdice.experiments.tosses.replay import (
    CONVERGED,
    MODEL,
    SCHEME,
    Errors,
    Paths,
    Physics,
    errors,
    faces,
    replay,
    scene_of,
    step_of,
    whole_step,
)
from stiffdice.scene import tosses as files
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.scene.tosses import Tosses

# Of each variant: what is other than in `full`, the model with the measured inertia from the first sample's launch.
VARIANTS = (
    "full",
    "flight_launch",
    "lengths_as_stored",
    "solid_inertia",
    "corner_inertia",
    "no_friction",
    "ungated",
    "no_rotation",
    "no_ground",
    "stays",
)
_PHYSICS: dict[str, dict[str, Any]] = {
    "solid_inertia": {"inertia": "solid"},
    "corner_inertia": {"inertia": "corners"},
    "no_friction": {"friction": 0.0},
    "ungated": {"law": "ungated"},
}
# Without rotation a cube keeps its face; without ground it has none in the end.
_KEEPING = "no_rotation", "stays"


def measure(
    scene: Scene,
    *,
    data: str = DATA,
    restitution: float = 0.125,
    friction: float = 0.18,
    contact_time: float = 0.005,
    seed: int = 18,
) -> xr.Dataset:
    """Return errors over time and final faces by variant of the model.

    scene: gives gravity and the contact law. data: a file of tosses. restitution, friction, contact_time [s]: of the
    board, the same for all variants. seed: of the third that was fitted, and is left out. Dimensions variant, toss; and
    variant, time: means over the tosses that are still measured. Raises InputError as `fit.measure` does.
    """
    tosses, _ = measured(data, scene.gravity)
    _, others = split(len(tosses.counts), validation.count("seed", seed, at_least=0))
    rest, stored = tosses.chosen(others), files.load(data).chosen(others)
    physics = Physics(restitution, friction, contact_time)
    times = np.arange(rest.counts.max()) / rest.rate
    each, over_time, right = [], [], []
    for variant in VARIANTS:
        ours = stored if variant == "lengths_as_stored" else rest
        off, face = _replayed(ours, scene, physics, variant)
        each.append(off.means(ours))
        over_time.append(_over_time(ours, off))
        right.append(np.where(face < 0, math.nan, face == ours.faces[ours.last]))
    running = np.array([(rest.counts > k).sum() for k in range(len(times))])
    variables = coordinates(variant=VARIANTS, time=times, toss=others) | {
        "path": quantity(("variant", "toss"), [one.path for one in each], "path error, mean over time, in sides"),
        "orientation": quantity(
            ("variant", "toss"), [one.orientation for one in each], "orientation error, mean over time", "rad"
        ),
        "right": quantity(("variant", "toss"), right, "1 if the final face is right"),
        "path_over_time": quantity(
            ("variant", "time"), [one.path for one in over_time], "path error, mean over tosses, in sides"
        ),
        "orientation_over_time": quantity(
            ("variant", "time"), [one.orientation for one in over_time], "orientation error, mean over tosses", "rad"
        ),
        "measured_tosses": quantity("time", running, "tosses that are still measured"),
    }
    about = {"side": rest.side, **physics._asdict(), "law": scene.ground.contact}
    return result(variables, "Models against real tosses", scene, MODEL, SCHEME, __name__, **about)


def _replayed(tosses: Tosses, scene: Scene, physics: Physics, variant: str) -> tuple[Errors, Array]:
    """Return the errors at each sample, and the face in the end; −1 where there is none."""
    launches = launches_of(tosses, "flight" if variant == "flight_launch" else "sample", scene.gravity)
    ours = scene_of(tosses, physics._replace(**_PHYSICS.get(variant, {})), scene)
    step = whole_step(tosses.rate, step_of(ours, CONVERGED))
    if variant == "stays":
        first = np.repeat(tosses.first, tosses.counts)
        paths = Paths(tosses.position[first], tosses.orientation[first])
    else:
        if variant == "no_ground":
            ours = ours.with_ground(stiffness=0.0, damping=0.0, friction=0.0)
        paths = replay(tosses, launches, ours, step, model="sliding" if variant == "no_rotation" else MODEL)
    if variant in _KEEPING:
        face = tosses.faces[tosses.first].astype(np.float64)
    elif variant == "no_ground":
        face = np.full(len(tosses.counts), -1.0)
    else:
        face = faces(launches, ours, step).astype(np.float64)
    return errors(tosses, paths), face


def _over_time(tosses: Tosses, found: Errors) -> Errors:
    """Return the means over the tosses that are still measured, shape (time,)."""
    sample = np.arange(len(tosses.position)) - np.repeat(tosses.first, tosses.counts)
    running = np.bincount(sample)
    return Errors(*(np.bincount(sample, part) / running for part in found))
