"""Work and precision: how far off every method is on one problem, against the force evaluations it takes.

A problem (`problems.py`) is run on grounds from soft to stiff by every scheme and by outside peers, each at a ladder of
efforts (`effort.py`). What a run is compared with is exact where that exists; other references tell by how much they
differ from it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.experiments.measuring import coordinates, numbers, quantity
from stiffdice.experiments.placement import contact_frequency, fall_speed, relaunched
from stiffdice.experiments.work_precision import effort as efforts
from stiffdice.experiments.work_precision.effort import ALL, Effort, fixed_step, methods_for, path_of
from stiffdice.experiments.work_precision.problems import (
    MEASURES,
    PROBLEMS,
    SAMPLES,
    Judge,
    Problem,
    scene_of,
    touchdown,
)
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.engines.registry import PEERS

# What may be taken for right, best first; a peer at the least tolerance it has.
REFERENCES: dict[str, Effort] = (
    {name: Effort(SAMPLES, math.nan) for name in sorted(efforts.EXACT)}
    | {name: Effort(SAMPLES, schemes.FINEST) for name in sorted(efforts.CONTROLLED)}  # finer than any rung
    | {"scipy_dop853": Effort(0, 1e-13), "scipy_lsoda": Effort(0, efforts.FINE)}
)

# So many first rungs may be too dear.
_TRIES = 2

# By how much a launch is changed, in radii and in the speed of the launch, to see what round-off in it may grow to.
_NUDGE = 1e-6

_HALF_UNIT = 2.0**-53

_NOTE = "the problem's: level ground, gated, at the stiffness of the dimension; the scheme is its method"
_AGREEMENT = "difference of a reference from the first, by each measure"
_FLOOR = "what half a unit in the last place becomes: low, one in the launch; high, one in the depth of a contact"

_DESCRIBED = {f"{name}_error": (text, "1") for name, text in MEASURES.items()} | {
    "evaluations": ("evaluations of the force in plain stepping", "1"),
    "evaluations_computed": ("evaluations of the force that were made, the others taken at once", "1"),
}


def measure(
    scene: Scene,
    *,
    problem: str = "flat-bounce",
    methods: Sequence[str] = (ALL,),
    stiffness: Sequence[float] = (1e2, 1e4, 1e6, 1e8, 1e10, 1e12),
    per_decade: int = 2,
    steps: float = 1e12,
    budget: int = 3_000_000,
) -> xr.Dataset:
    """Return errors and force evaluations, dimensions stiffness, method, effort (NaN and 0 past a ladder's end).

    problem: a name of PROBLEMS. methods: names of schemes and peers. stiffness [kg/s²]. per_decade: efforts in a decade
    of steps or tolerance. steps: most of a fixed step's ladder. budget: most force evaluations of a run that are made,
    those taken at once not counted; a peer's ladder ends at its part of it (`Peer.dearness`).
    `agreement` has the difference of each reference from the first, `floor` what half a unit in the last place grows
    to: in the launch, and in the place during a contact, where it is one of the depth.
    Raises InputError for a number out of range, and for a scene in which the cube does not land and leave again.
    """
    chosen = PROBLEMS[validation.choice("problem", problem, PROBLEMS)]
    grounds = numbers("stiffness", stiffness, "kg/s²", above=0)
    per_decade, budget = validation.count("per_decade", per_decade), validation.count("budget", budget)
    steps = validation.number("steps", steps, "1", at_least=SAMPLES)
    scenes = [scene_of(chosen, scene, value) for value in grounds]
    names, fit = efforts.chosen_from(chosen, methods), methods_for(chosen)
    sources = [name for name in REFERENCES if name in fit]
    found, agreement, floor = [], [], []
    for ground in scenes:
        paths = [path_of(chosen, ground, name, REFERENCES[name], budget) for name in sources]
        judge = Judge(chosen, ground, paths[0].states)
        agreement.append([list(judge.errors(path.states).values()) for path in paths])
        floor.append(_floors(chosen, ground, sources[0], judge, budget))
        found.append([_climbed(chosen, ground, name, judge, per_decade, steps, budget) for name in names])
    variables = coordinates(
        stiffness=grounds, method=names, source=sources, bound=["low", "high"], measure=MEASURES
    ) | efforts.by_effort(found, _DESCRIBED)
    variables["agreement"] = quantity(("stiffness", "source", "measure"), agreement, _AGREEMENT)
    variables["floor"] = quantity(("stiffness", "bound", "measure"), floor, _FLOOR)
    title = f"Work and precision: {chosen.name}"
    attributes = dataset.provenance_attributes(title, scene, chosen.model, "method", __name__)
    attributes |= {"scene_note": _NOTE, "problem": problem, "samples": SAMPLES, "reference": sources[0]}
    return xr.Dataset(variables, attrs=attributes | engines.attributes(names))


def _climbed(
    problem: Problem, scene: Scene, method: str, judge: Judge, per_decade: int, steps: float, budget: int
) -> list[dict[str, float]]:
    """Return the rungs of a method's ladder that the budget allows.

    The first may be too dear where later ones are not: a cube that a long step keeps on the ground has no flights.
    """
    rungs: list[dict[str, float]] = []
    too_dear = 0
    most = budget / engines.METHODS[method].dearness
    growth = 10 ** (1 / per_decade) if fixed_step(method) else 1.0  # known beforehand
    for effort in efforts.ladder(scene, method, per_decade, steps):
        if len(rungs) > 1 and rungs[-1]["evaluations_computed"] * growth > most:
            break
        if method in PEERS and effort.steps > most:  # an engine takes every one of them
            break
        path = path_of(problem, scene, method, effort, budget)
        if path.computed >= most:
            too_dear += 1
            if rungs or too_dear == _TRIES:
                break
            continue
        errors = judge.errors(path.states, efforts.lag_time(scene, method, effort))
        rungs.append(
            effort._asdict()
            | {f"{name}_error": error for name, error in errors.items()}
            | {"evaluations": path.evaluations, "evaluations_computed": path.computed}
        )
    return rungs


def _floors(problem: Problem, scene: Scene, source: str, judge: Judge, budget: int) -> Array:
    """Return for each measure what half a unit in the last place becomes, in the launch and in a contact.

    In the launch: each number of it is nudged alone, and the changes are added as if at random. In a contact an error
    of the place is one of the depth, which is only v/ω: relative to what the contact does it is ω r/v times as large.
    """
    radius = scene.cube.radius
    speed = fall_speed(scene, scene.launch.position[2] - touchdown(scene))
    scenes = _nudged(scene, _NUDGE * radius, _NUDGE * speed, problem.turns)
    paths = [path_of(problem, nudged, source, REFERENCES[source], budget) for nudged in scenes]
    grown = np.array([[*judge.errors(path.states).values()] for path in paths]) / _NUDGE
    # A measure is a number itself, of the order of one.
    launch = np.fmax(1.0, np.sqrt((grown**2).sum(axis=0))) * _HALF_UNIT
    return np.array([launch, launch * max(1.0, contact_frequency(scene) * radius / speed)])


def _nudged(scene: Scene, place: float, speed: float, turns: bool) -> list[Scene]:
    """Return the scene with each number of its launch changed alone, by so much place [m] and speed [m/s]."""
    launch, spin = scene.launch, speed * scene.cube.moment_of_inertia / scene.cube.radius
    changes = {"position": place, "velocity": speed} | ({"angular_momentum": spin} if turns else {})
    scenes = []
    for key, change in changes.items():
        value = np.array(launch.spin if key == "angular_momentum" else getattr(launch, key))
        scenes += [relaunched(scene, **{key: tuple(moved)}) for moved in (value + change * np.eye(3)).tolist()]
    return scenes
