"""How many steps a second: the same motion in steps of the same size, by every method of fixed step.

What is timed is stepping alone, one run at a time: each engine has built its model of the scene before. A method that
takes steps of its own is measured by its force evaluations.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.experiments.engines.limits import METHODS
from stiffdice.experiments.measuring import coordinates, quantity
from stiffdice.experiments.timing import Launched, interleaved, machine
from stiffdice.experiments.work_precision.problems import PROBLEMS, SAMPLES, scene_of
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import registry as engines

TIMED = ("flat-bounce", "tumbling-throw")


def time(
    scene: Scene,
    *,
    methods: Sequence[str] = METHODS,
    steps: int = 6_000,
    affordable: float = 0.5,
    rounds: int = 9,
) -> xr.Dataset:
    """Return median times of runs [s] and what they took, dimensions problem, method; not-a-number where one is unfit.

    scene: the problems of TIMED are made of it, at its own stiffness. methods: names of schemes and engines. steps:
    of each run of the scene's duration. affordable [s]: a longer run is timed once. rounds: in each every run is timed.
    Raises InputError for a number out of range, and an engine that is not installed.
    """
    names = engines.chosen_from(methods)
    steps = SAMPLES * max(1, validation.count("steps", steps) // SAMPLES)
    affordable, rounds = validation.number("affordable", affordable, "s", above=0), validation.count("rounds", rounds)
    seconds, spread, taken = np.full((3, len(TIMED), len(names)), np.nan)
    for p, problem in enumerate(PROBLEMS[name] for name in TIMED):
        there = scene_of(problem, scene, scene.ground.stiffness)
        fit = [k for k, name in enumerate(names) if engines.adapter_of(name).unfit(there, problem.model) is None]
        runs = [Launched(engines.ready(names[k], there, problem.model, steps, SAMPLES)) for k in fit]
        own = [engines.METHODS[names[k]].own_steps for k in fit]
        counted: Array = np.array([run.ready()().evaluations for run in runs])  # what is not compiled yet is now
        taken[p, fit] = np.where(own, counted, steps)
        seconds[p, fit], spread[p, fit] = interleaved(runs, rounds, affordable)
    attributes = dataset.provenance_attributes("Steps a second", scene, "problem", "method", __name__)
    attributes |= engines.attributes(names) | machine() | {"steps": steps, "samples": SAMPLES, "rounds": rounds}
    grid = ("problem", "method")
    variables = coordinates(problem=TIMED, method=names) | {
        "seconds": quantity(grid, seconds, "median wall time of a run, started before", "s"),
        "spread": quantity(grid, spread, "half the range between the quartiles of the times over their median"),
        "taken": quantity(grid, taken, "steps of the run; force evaluations of one that takes its own steps"),
    }
    return xr.Dataset(variables, attrs=attributes)
