"""How long the runs of `work_precision` take: every scheme's plain stepping, and the outside peers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import xarray as xr

from stiffdice.experiments.measuring import coordinates, numbers, quantity
from stiffdice.experiments.timing import Launched, interleaved, machine, seconds_of
from stiffdice.experiments.work_precision.effort import (
    ALL,
    GRID,
    Effort,
    by_effort,
    chosen_from,
    fixed_step,
    ladder,
    plain,
)
from stiffdice.experiments.work_precision.problems import PROBLEMS, SAMPLES, Problem, scene_of
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import registry as engines

# A run on a ladder, to be timed.
Rung = tuple[Effort, Callable[[], object]]

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
    that. rounds: in each every run is timed, warm. Raises InputError as the experiment does.
    """
    chosen = PROBLEMS[validation.choice("problem", problem, PROBLEMS)]
    grounds = numbers("stiffness", stiffness, "kg/s²", above=0)
    affordable = validation.number("affordable", affordable, "s", above=0)
    per_decade, rounds = validation.count("per_decade", per_decade), validation.count("rounds", rounds)
    names = chosen_from(chosen, methods)
    found, per_step = [], []
    for value in grounds:
        ground = scene_of(chosen, scene, value)
        climbed = [_climbed(chosen, ground, name, per_decade, affordable) for name in names]
        times, _ = interleaved([run for rungs in climbed for _, run in rungs], rounds, affordable)
        taken = iter(times.tolist())
        found.append([[effort._asdict() | {"seconds": next(taken)} for effort, _ in rungs] for rungs in climbed])
        ends = zip(names, (rungs[-1] for rungs in found[-1]), strict=True)
        per_step.append([end["seconds"] / end["steps"] if fixed_step(name) else math.nan for name, end in ends])
    variables = coordinates(stiffness=grounds, method=names)
    variables |= by_effort(found, {"seconds": ("median wall time of a run", "s")})
    variables["seconds_per_step"] = quantity(GRID[:2], per_step, _PER_STEP, "s")
    title = f"Time of work and precision: {chosen.name}"
    attributes = dataset.provenance_attributes(title, scene, chosen.model, "method", __name__)
    attributes |= {"problem": problem, "samples": SAMPLES, "rounds": rounds}
    return xr.Dataset(variables, attrs=attributes | engines.attributes(names) | machine())


def _climbed(problem: Problem, scene: Scene, method: str, per_decade: int, affordable: float) -> list[Rung]:
    """Return the rungs to be timed, called once each, the first twice."""
    rungs: list[Rung] = []
    took = 0.0
    for effort in ladder(scene, method, per_decade, math.inf):
        if fixed_step(method) and rungs and took * effort.steps / rungs[-1][0].steps > affordable:
            break
        run = Launched(plain(problem, scene, method, effort))
        if not rungs:  # it may compile
            run()
        took = seconds_of(run)
        rungs.append((effort, run))
        if took > _END * affordable:
            break
    return rungs[-_RUNGS:] if fixed_step(method) else rungs
