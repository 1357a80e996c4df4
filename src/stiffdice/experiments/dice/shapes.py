"""How often a square box (a, a, c) lands on one of its ends, by c/a and by the ground; beside models and measurements.

The volume is that of the scene's cube. The launch is the scene's, with every orientation as likely and Gaussian
velocity and spin (`launch_distribution`).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.errors import InputError
from stiffdice.experiments.dice import models
from stiffdice.experiments.dice.axes import pairs_of
from stiffdice.experiments.dice.boxes import MODEL, SCHEME, Throwing, box_of, faces_up
from stiffdice.experiments.measuring import Variable, coordinates, mapped, numbers, quantity, result
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene

# Of the measured boxes from which χ is taken, in ln(c/a).
_NEAR = 0.5

_FOUND = {
    "end_pair": ("part of the settled throws with one of the two ends up", "1"),
    "end_pair_error": ("its standard error, binomial", "1"),
    "unsettled": ("part of the throws that did not settle", "1"),
    "ends": ("throws with one of the two ends up", "1"),
}


def measure(
    scene: Scene,
    *,
    aspect: Sequence[float] = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4, 1.6, 1.9, 2.3, 2.7),
    restitution: Sequence[float] = (0.3, 0.45, 0.6),
    friction: Sequence[float] = (0.1, 0.2, 0.3),
    velocity_spread: float = 0.3,
    spin_spread: float = 30.0,
    contact_time: float = 1e-3,
    steps: int = 20_000,
    throws: int = 10_000,
    seed: int = 1,
    measured_aspect: Sequence[float] = (),
    measured_part: Sequence[float] = (),
    measured_throws: Sequence[float] = (),
) -> xr.Dataset:
    """Return the part of throws that end on one of the two square ends, dimensions aspect, restitution and friction.

    scene: gives mass, volume, launch, gravity and duration; the ground is level. aspect [1]: c/a. restitution, friction
    [1], contact_time [s]: of the ground. velocity_spread [m/s], spin_spread [rad/s]: of the launches. steps: in the
    duration. throws: of each box on each ground; seed: of the first. measured_aspect, measured_part, measured_throws:
    published measurements to store beside, c/a, part on the ends and throws of each. Raises InputError for a number out
    of range.
    """
    shapes = numbers("aspect", aspect, "1", above=0)
    grounds = {"restitution": numbers("restitution", restitution, "1", above=0)}
    grounds["friction"] = numbers("friction", friction, "1", at_least=0)
    throwing = Throwing(velocity_spread, spin_spread, contact_time, steps, throws)
    published = _measured(measured_aspect, measured_part, measured_throws)
    seeds = iter(range(validation.count("seed", seed, at_least=0), 2**53))

    def ends(c: float, e: float, mu: float) -> tuple[float, float, float, int]:
        box = box_of(scene, e, mu, contact_time, stretch=(0.0, 0.0, math.log(c)))
        counts, unsettled = faces_up(box, throwing, next(seeds))
        settled, on_ends = int(counts.sum()), int(pairs_of(counts)[2])
        p, smoothed = on_ends / settled, (on_ends + 0.5) / (settled + 1)
        return p, math.sqrt(smoothed * (1 - smoothed) / settled), unsettled / throws, on_ends

    found = mapped(ends, _FOUND, aspect=shapes, **grounds)
    settled = throws * (1 - np.array(found["unsettled"][1]))
    betas = np.array(
        [
            [models.fitted_beta(shapes, found["ends"][1][:, i, j], settled[:, i, j]) for j in range(settled.shape[2])]
            for i in range(settled.shape[1])
        ]
    )
    middle = len(betas) // 2, len(betas[0]) // 2
    found["gibbs_beta"] = quantity(("restitution", "friction"), betas, "likeliest beta of the Gibbs distribution")
    by_model: dict[str, Callable[[Any], Array]] = {
        "solid_angle": models.solid_angle,
        "gibbs": partial(models.gibbs, beta=float(betas[middle])),
        "pender_uhrin": models.pender_uhrin,
    }
    for name, model in by_model.items():
        found[name] = quantity("aspect", model(shapes), f"part on the ends by the model {name}")
        found[f"{name}_slope"] = quantity((), models.slope(model(models.NEAR_CUBE)), f"chi of the model {name}")
    found |= published
    note = "body and ground are the experiment's, not the scene's; ground: level, gated"
    told = dataclasses.asdict(throwing) | {"scene_note": note}
    told |= {"gibbs_restitution": grounds["restitution"][middle[0]], "gibbs_friction": grounds["friction"][middle[1]]}
    return result(found, "Ends of square boxes", scene, MODEL, SCHEME, __name__, **told)


def _measured(aspect: Sequence[float], part: Sequence[float], throws: Sequence[float]) -> dict[str, Variable]:
    """Return published measurements as variables over `specimen`; none where there are none."""
    if not len(aspect) == len(part) == len(throws):
        raise InputError("measured_aspect, measured_part, measured_throws: allowed are lists of one length")
    if not aspect:
        return {}
    for value in numbers("measured_part", part, "1", at_least=0):
        if value > 1:
            raise InputError(f"measured_part = {value:g}: allowed is a number from 0 to 1")
    many = [validation.count("measured_throws", value) for value in throws]
    found = coordinates(specimen=range(len(aspect)))
    shapes = numbers("measured_aspect", aspect, "1", above=0)
    found["measured_aspect"] = quantity("specimen", shapes, "measured c/a")
    found["measured_part"] = quantity("specimen", list(part), "measured part of the throws on an end")
    found["measured_throws"] = quantity("specimen", many, "throws of the measurement")
    chi, error = _slope_at_cube(np.array(shapes), np.array(part), np.array(many))
    found["measured_chi"] = quantity((), chi, "chi of the measured parts, by a parabola of the log odds")
    found["measured_chi_error"] = quantity((), error, "its standard error, binomial")
    return found


def _slope_at_cube(aspect: Array, part: Array, throws: Array) -> tuple[float, float]:
    """Return χ and its error from the boxes with |ln(c/a)| <= `_NEAR`; not-a-number where two of them are missing.

    The likeliest k and q of ln(2p/(1 − p)) = k x + q x², x = ln(c/a), which is the response of the faces to second
    order (`response`), by Newton's method; χ = 2k/3.
    """
    x = np.log(aspect)
    near = np.abs(x) <= _NEAR
    if len(set(x[near])) < 2:
        return math.nan, math.nan
    terms, ends, throws = np.stack([x, x * x])[:, near], (part * throws)[near], throws[near]
    found, information = np.zeros(2), np.eye(2)
    for _ in range(50):
        p = 1 / (1 + 2 * np.exp(-found @ terms))
        information = (terms * throws * p * (1 - p)) @ terms.T
        found += np.clip(np.linalg.solve(information, terms @ (ends - throws * p)), -1.0, 1.0)
    return float(2 / 3 * found[0]), float(2 / 3 * math.sqrt(np.linalg.inv(information)[0, 0]))
