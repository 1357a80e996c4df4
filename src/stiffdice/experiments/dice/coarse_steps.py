"""How coarse steps may be where only the faces' probabilities count, against those that a path needs.

Two currencies for the error of a step. Paths: how far from where the cube comes to rest in the reference, over how far
it was thrown, the median over launches, and the share of launches whose face is another. Probabilities: the total
variation between the distributions of faces, half the sum of the differences. A throw is chaotic: a path is lost at
steps that the probabilities do not feel. Sampling makes two samples of one distribution differ, too; that is told
beside.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from functools import partial

import numpy as np
import xarray as xr

from stiffdice.errors import InputError
from stiffdice.experiments.dice import counts as counting
from stiffdice.experiments.dice import throws as throwing
from stiffdice.experiments.dice.landing import launches_of
from stiffdice.experiments.dice.throws import steps_at
from stiffdice.experiments.measuring import Variable, coordinates, numbers, quantity, result
from stiffdice.scene import die, validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import progress
from stiffdice.simulation.landing import BATCHED, MODEL, land
from stiffdice.simulation.launch_distribution import LaunchDistribution

# Force evaluations of a step; `event` takes its own.
EVALUATIONS = {"symplectic_euler": 1, "forward_euler": 1, "velocity_verlet": 2, "rk4": 4, "implicit_euler": 3}
REFERENCE = "event"
# Output intervals of the reference: a face is looked at this often.
_INTERVALS = 2000
# Work of a path, which no other is stepped beside and which goes on when its face is known, over that of a throw.
_DEARER = 80


def measure(
    scene: Scene,
    *,
    omega_h: Sequence[float] = (1.5, 1.2, 1.0, 0.8, 0.6, 0.4, 0.3),
    finest: float = 0.15,
    throws: int = 200_000,
    path_omega_h: Sequence[float] = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005),
    path_schemes: Sequence[str] = ("symplectic_euler", "velocity_verlet", "rk4"),
    paths: int = 200,
    orientation: str = "uniform",
    velocity_spread: float = 0.3,
    spin: str = "gaussian",
    spin_spread: float = 30.0,
    seed: int = 0,
) -> xr.Dataset:
    """Return what steps do to the faces' distribution, dimension omega_h, and to paths, scheme and path_omega_h.

    scene: the die, its ground and the mean launch. omega_h [1]: of the fastest contact, at which the probabilities are
    measured by the paper's scheme; finest: that of the distribution with which they are compared. throws: of each.
    path_omega_h, path_schemes, paths: steps, schemes and number of launches for paths, compared with `event`. The rest
    as of `landing`. Raises InputError for a value out of range.
    """
    launches = launches_of(orientation, velocity_spread, spin, spin_spread, seed)
    throws, paths = validation.count("throws", throws), validation.count("paths", paths)
    ladder = numbers("omega_h", omega_h, "1", above=0)
    finest = validation.number("finest", finest, "1", above=0)
    if not finest < min(ladder, default=math.inf):
        raise InputError(f"finest = {finest:g}: allowed is a number below all of omega_h = {ladder} [1]")
    for scheme in path_schemes:
        validation.choice("path_schemes", scheme, EVALUATIONS)
    path_ladder = numbers("path_omega_h", path_omega_h, "1", above=0)
    stages = (
        partial(_distributions, scene, launches, ladder, finest, throws),
        partial(_paths, scene, launches, path_schemes, path_ladder, paths),
    )
    thrown = throws * sum(1 / value for value in (finest, *ladder))
    followed = paths * sum(1 / value for value in path_ladder) * sum(EVALUATIONS[scheme] for scheme in path_schemes)
    found: dict[str, Variable] = {}
    for stage in progress.each(stages, [thrown, _DEARER * followed]):
        found |= stage()
    found |= coordinates(face=die.FACES, omega_h=ladder, path_omega_h=list(path_omega_h), scheme=list(path_schemes))
    told = {"throws": throws, "paths": paths, "finest_omega_h": finest, "seed": seed, "orientation": orientation}
    told |= {"velocity_spread": launches.velocity_spread, "spin": spin, "spin_spread": spin_spread}
    return result(found, "What coarse steps do to faces and to paths", scene, MODEL, BATCHED, __name__, **told)


def _distributions(
    scene: Scene, launches: LaunchDistribution, ladder: Sequence[float], finest: float, throws: int
) -> dict[str, Variable]:
    """Return the variables of the distributions at each ωh, compared with those at the finest."""
    # Another seed: samples that share launches agree more than distributions do.
    other = dataclasses.replace(launches, seed=launches.seed + 1)
    asked = [(launches, finest, False), *((other, value, True) for value in ladder)]
    best, *coarse = [
        throwing.many(scene, drawn, BATCHED, steps_at(scene, value), throws, empty=empty)
        for drawn, value, empty in progress.each(asked, [1 / value for _, value, _ in asked])
    ]
    rows = []
    for found in coarse:
        total, settled = max(1, found.counts.sum()), found.counts.sum() / throws
        share = best.counts / best.counts.sum()
        mean, most = counting.sampling_distance(share, int(total), int(best.counts.sum()))
        distance = counting.total_variation(found.counts, best.counts) if found.counts.sum() else 1.0
        rows.append((found.counts, distance, mean, most, settled, found.evaluations / throws))
    counts, distances, means, mosts, settled_shares, work = (np.array(column) for column in zip(*rows, strict=True))
    by = "omega_h"
    return {
        "count": quantity((by, "face"), counts, "throws that ended with this face up"),
        "finest_count": quantity("face", best.counts, "the same with the finest steps"),
        "total_variation": quantity(by, distances, "total variation to the distribution of the finest steps"),
        "sampling_mean": quantity(by, means, "mean total variation of two such samples of one distribution"),
        "sampling_95": quantity(by, mosts, "95 % quantile of the total variation of two such samples"),
        "settled": quantity(by, settled_shares, "share of the throws that settled"),
        "evaluations": quantity(by, work, "force evaluations of a throw until it is decided, mean"),
    }


def _paths(
    scene: Scene, launches: LaunchDistribution, schemes: Sequence[str], ladder: Sequence[float], paths: int
) -> dict[str, Variable]:
    """Return the variables of paths by each scheme at each ωh, compared with the reference."""
    drawn = launches.draw(scene, paths)
    best = land(scene, drawn, scheme=REFERENCE, steps=_INTERVALS, early_stop=False)
    away = np.linalg.norm(best.ends["position"][:, :2] - drawn["position"][:, :2], axis=1)
    errors, changed, work = np.zeros((3, len(schemes), len(ladder)))
    places = [*itertools.product(enumerate(schemes), enumerate(ladder))]
    for (i, scheme), (j, value) in progress.each(places, [EVALUATIONS[by] / at for (_, by), (_, at) in places]):
        steps = steps_at(scene, value)
        found = land(scene, drawn, scheme=scheme, steps=steps, early_stop=False)
        with np.errstate(invalid="ignore", over="ignore"):
            off = np.linalg.norm(found.ends["position"] - best.ends["position"], axis=1) / np.median(away)
        errors[i, j] = np.median(np.where(np.isfinite(off), off, np.inf))
        changed[i, j] = (found.face != best.face).mean()
        decided = land(scene, drawn, scheme=scheme, steps=steps)
        work[i, j] = decided.steps.mean() * EVALUATIONS[scheme]
    by = ("scheme", "path_omega_h")
    return {
        "path_error": quantity(by, errors, "distance from the reference at the end over that thrown, median"),
        "face_changed": quantity(by, changed, "share of launches that end on another face than in the reference"),
        "path_evaluations": quantity(by, work, "force evaluations of a throw until it is decided, mean"),
        "distance": quantity((), np.median(away), "how far a die is thrown along the ground, median", "m"),
    }
