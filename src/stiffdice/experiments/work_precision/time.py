"""How long the runs of `work_precision` take: every scheme's plain stepping, and the outside peers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import xarray as xr

from stiffdice.experiments import options
from stiffdice.experiments.layout import method_axis, of_cells, quantity
from stiffdice.experiments.timing import Launched, Times, interleaved, machine, seconds_of
from stiffdice.experiments.work_precision.effort import ALL, Effort, by_effort, chosen_from, fixed_step, ladder, plain
from stiffdice.experiments.work_precision.problems import PROBLEMS, SAMPLES, Problem, scene_of
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import stepper


class Rung(NamedTuple):
    """One run on a ladder, and how long its first call took [s]."""

    effort: Effort
    run: Callable[[], object]
    first: float


_DESCRIBED = {
    "seconds": ("median wall time of a run", "s"),
    "spread": ("half the range between the quartiles of the times over their median", "1"),
}
_PER_STEP = "wall time per step of a fixed step, from the longest run timed"

# Of a fixed step's ladder so many rungs are timed, the longest that are affordable: time is proportional to steps.
_RUNGS = 3
# Any other ladder ends with the run that takes so many times what is affordable.
_END = 3


def time(
    scene: Scene,
    *,
    problem: str = "flat-bounce",
    methods: Sequence[str] = (ALL,),
    stiffness: Sequence[float] = (1e2, 1e4, 1e6, 1e8, 1e10, 1e12),
    per_decade: int = 2,
    affordable: float = 0.03,
    rounds: int = 7,
) -> xr.Dataset:
    """Return median times [s], dimensions stiffness, method, effort (NaN past a ladder's end).

    problem, methods, stiffness, per_decade: as for the experiment `work-precision`. affordable [s]: longer runs are
    timed once. The ladder of a fixed step ends there, as above it `seconds_per_step` says, any other after three times
    that. rounds: in each every run is timed; the median is stored. `first_seconds` is a method's first call in a fresh
    process, which loads compiled code, or compiles it if nobody has; everything else is warm.

    Raises InputError as the experiment does.
    """
    chosen = PROBLEMS[validation.choice("problem", problem, PROBLEMS)]
    grounds = options.stiffnesses(stiffness)
    affordable = validation.number("affordable", affordable, "s", above=0)
    per_decade, rounds = validation.count("per_decade", per_decade), validation.count("rounds", rounds)
    names = chosen_from(chosen, methods)
    climbed, times = [], []
    for value in grounds:
        ground = scene_of(chosen, scene, value)
        climbed.append([_climbed(chosen, ground, name, per_decade, affordable) for name in names])
        times.append(interleaved([rung.run for rungs in climbed[-1] for rung in rungs], rounds, affordable))
    rows = [_numbers(rungs_of, taken) for rungs_of, taken in zip(climbed, times, strict=True)]
    per_step = [[_per_step(name, rungs) for name, rungs in zip(names, row, strict=True)] for row in rows]
    attributes = dataset.provenance_attributes(
        f"Time of work and precision: {chosen.name}", scene, chosen.model, "method", __name__
    )
    return xr.Dataset(
        by_effort(rows, _DESCRIBED)
        | {
            "seconds_per_step": quantity(("stiffness", "method"), per_step, _PER_STEP, "s"),
            "first_seconds": quantity(
                "method", [rungs[0].first for rungs in climbed[0]], "first call in a fresh process", "s"
            ),
        },
        {"stiffness": of_cells("stiffness", grounds), "method": method_axis(names)},
        attributes | {"problem": problem, "samples": SAMPLES, "rounds": rounds} | stepper.attributes(names) | machine(),
    )


def _per_step(method: str, rungs: Sequence[dict[str, float]]) -> float:
    return rungs[-1]["seconds"] / rungs[-1]["steps"] if fixed_step(method) else math.nan


def _numbers(climbed: Sequence[Sequence[Rung]], times: Times) -> list[list[dict[str, float]]]:
    """Return the numbers of each rung, by method; times: of all rungs, one method after another."""
    taken = iter(zip(times.median, times.spread, strict=True))
    return [
        [rung.effort._asdict() | dict(zip(("seconds", "spread"), next(taken), strict=True)) for rung in rungs]
        for rungs in climbed
    ]


def _climbed(problem: Problem, scene: Scene, method: str, per_decade: int, affordable: float) -> list[Rung]:
    """Return the rungs to be timed, called once each, the first twice."""
    rungs: list[Rung] = []
    took = 0.0
    for effort in ladder(scene, method, per_decade, math.inf):
        if fixed_step(method) and rungs and took * effort.steps / rungs[-1].effort.steps > affordable:
            break
        run = Launched(plain(problem, scene, method, effort))
        first = took = seconds_of(run)
        if not rungs:  # it may have compiled
            took = seconds_of(run)
        rungs.append(Rung(effort, run, first))
        if took > _END * affordable:
            break
    return rungs[-_RUNGS:] if fixed_step(method) else rungs
