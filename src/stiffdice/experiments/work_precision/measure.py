"""Work and precision: how far off every method is on one problem, against the force evaluations it takes.

A problem (`problems.py`) is run on grounds from soft to stiff by every scheme and by outside peers, each at a ladder of
efforts (`effort.py`). What a run is compared with is exact where that exists; other references tell by how much they
differ from it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.experiments.work_precision.effort import (
    ALL,
    CONTROLLED,
    EXACT,
    FINE,
    Effort,
    chosen_from,
    fixed_step,
    ladder,
    lag_time,
    methods_for,
    path_of,
)
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
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import stepper
from stiffdice.simulation.engines.registry import PEERS
from stiffdice.simulation.fixed_step import Path

# What may be taken for right, best first; a peer is asked for all it can give.
REFERENCES: dict[str, Effort] = (
    {name: Effort(SAMPLES, math.nan) for name in sorted(EXACT)}
    | {name: Effort(SAMPLES, schemes.FINEST) for name in sorted(CONTROLLED)}  # finer than any rung
    | {"scipy_dop853": Effort(0, 1e-13), "scipy_lsoda": Effort(0, FINE)}
)

# So many first rungs may be too dear.
_TRIES = 2

# By how much a launch is changed, in radii and in the speed of the launch, to see what round-off in it may grow to.
_NUDGE = 1e-6

_HALF_UNIT = 2.0**-53


class Rung(NamedTuple):
    """One run on a ladder: what was spent, and how far off it was by each measure."""

    effort: Effort
    path: Path
    errors: dict[str, float]


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
    of steps or tolerance. steps: most of a fixed step's ladder. budget: most force evaluations of a run that are made;
    where flights, or contacts that are known, are taken at once, a run may have many more. A peer's ladder ends at its
    part of it (`Peer.dearness`).
    `evaluations` are those of plain stepping, `evaluations_computed` those made. `agreement` has the difference of each
    reference from the first, `floor` what half a unit in the last place grows to: in the launch, and in the place
    during a contact, where it is one of the depth.

    Raises InputError for a number out of range, and for a scene in which the cube does not land and leave again.
    """
    chosen = PROBLEMS[validation.choice("problem", problem, PROBLEMS)]
    grounds = [validation.number("stiffness", value, "kg/s²", above=0) for value in stiffness]
    per_decade, budget = validation.count("per_decade", per_decade), validation.count("budget", budget)
    steps = validation.number("steps", steps, "1", at_least=SAMPLES)
    scenes = [scene_of(chosen, scene, value) for value in grounds]
    names, fit = chosen_from(chosen, methods), methods_for(chosen)
    sources = [name for name in REFERENCES if name in fit]
    found, agreement, floor = [], [], []
    for ground in scenes:
        paths = [path_of(chosen, ground, name, REFERENCES[name], budget) for name in sources]
        judge = Judge(chosen, ground, paths[0].states)
        agreement.append([list(judge.errors(path.states).values()) for path in paths])
        floor.append(_floors(chosen, ground, sources[0], judge, budget))
        found.append([_climbed(chosen, ground, name, judge, per_decade, steps, budget) for name in names])
    attributes = dataset.provenance_attributes(
        f"Work and precision: {chosen.name}",
        scene,
        chosen.model,
        "method",
        "stiffdice.experiments.work_precision.measure",
    ) | {
        "scene_note": "the problem's: level ground, gated, at the stiffness of the dimension; the scheme is its method",
        "problem": problem,
        "samples": SAMPLES,
        "reference": sources[0],
    }
    attributes |= stepper.attributes(names)
    return xr.Dataset(
        _variables(found) | _reference_variables(agreement, floor),
        dataset.method_coordinates(grounds, names)
        | {
            "source": ("source", np.arange(len(sources), dtype=np.int8), enum_attributes("reference", sources)),
            "bound": ("bound", np.arange(2, dtype=np.int8), enum_attributes("bound of the floor", ["low", "high"])),
            "measure": ("measure", np.arange(len(MEASURES), dtype=np.int8), enum_attributes("error", list(MEASURES))),
        },
        attributes,
    )


def _climbed(
    problem: Problem, scene: Scene, method: str, judge: Judge, per_decade: int, steps: float, budget: int
) -> list[Rung]:
    """Return the rungs of a method's ladder that the budget allows.

    The first may be too dear where later ones are not: a cube that a long step keeps on the ground has no flights.
    """
    rungs: list[Rung] = []
    too_dear = 0
    most = budget / stepper.dearness(method)
    growth = 10 ** (1 / per_decade) if fixed_step(method) else 1.0  # known beforehand
    for effort in ladder(scene, method, per_decade, steps):
        if len(rungs) > 1 and rungs[-1].path.computed * growth > most:
            break
        if method in PEERS and effort.steps > most:  # an engine takes every one of them
            break
        path = path_of(problem, scene, method, effort, budget)
        if path.computed >= most:
            too_dear += 1
            if rungs or too_dear == _TRIES:
                break
            continue
        rungs.append(Rung(effort, path, judge.errors(path.states, lag_time(scene, method, effort))))
    return rungs


def _floors(problem: Problem, scene: Scene, source: str, judge: Judge, budget: int) -> list[list[float]]:
    """Return for each measure what half a unit in the last place becomes, in the launch and in a contact.

    In the launch: each number of it is nudged alone, and the changes are added as if at random. In a contact an error
    of the place is one of the depth, which is only v/ω: relative to what the contact does it is ω r/v times as large.
    """
    nudge, radius = _NUDGE, scene.cube.radius
    speed = math.sqrt(2 * scene.gravity * (scene.launch.position[2] - touchdown(scene)) + scene.launch.velocity[2] ** 2)
    squares = dict.fromkeys(MEASURES, 0.0)
    for nudged in _nudged(scene, nudge * radius, nudge * speed, problem.turns):
        errors = judge.errors(path_of(problem, nudged, source, REFERENCES[source], budget).states)
        squares = {name: squares[name] + (errors[name] / nudge) ** 2 for name in MEASURES}
    # A measure is a number itself, of the order of one.
    launch = [max(1.0, math.sqrt(square)) * _HALF_UNIT for square in squares.values()]
    deep = linear_theory.contact_frequency(scene.ground.stiffness, scene.cube.mass) * radius / speed
    return [launch, [part * max(1.0, deep) for part in launch]]


def _nudged(scene: Scene, place: float, speed: float, turns: bool) -> list[Scene]:
    """Return the scene with each number of its launch changed alone, by so much place [m] and speed [m/s]."""
    launch, spin = scene.launch, speed * scene.cube.moment_of_inertia / scene.cube.radius
    changes = {"position": place, "velocity": speed} | ({"angular_momentum": spin} if turns else {})
    scenes = []
    for key, change in changes.items():
        for axis in range(3):
            value = np.array(launch.spin if key == "angular_momentum" else getattr(launch, key))
            value[axis] += change
            moved: Any = {key: (float(value[0]), float(value[1]), float(value[2]))}
            scenes.append(dataclasses.replace(scene, launch=dataclasses.replace(launch, **moved)))
    return scenes


def _variables(found: Sequence[Sequence[Sequence[Rung]]]) -> dict[str, Any]:
    """Return what was found as variables, dimensions stiffness, method, effort."""
    longest = max(1, *(len(rungs) for row in found for rungs in row))
    shape = len(found), len(found[0]), longest
    numbers = {name: np.full(shape, np.nan) for name in ("tolerance", *(f"{name}_error" for name in MEASURES))}
    counts = {name: np.zeros(shape, np.int64) for name in ("steps", "evaluations", "evaluations_computed")}
    for i, k in np.ndindex(shape[:2]):
        for j, (effort, path, errors) in enumerate(found[i][k]):
            counts["steps"][i, k, j] = effort.steps
            counts["evaluations"][i, k, j] = path.evaluations
            counts["evaluations_computed"][i, k, j] = path.computed
            numbers["tolerance"][i, k, j] = effort.tolerance
            for name, error in errors.items():
                numbers[f"{name}_error"][i, k, j] = error
    texts = {f"{name}_error": text for name, text in MEASURES.items()} | {
        "evaluations": "evaluations of the force in plain stepping",
        "evaluations_computed": "evaluations of the force that were made, the others taken at once",
    }
    told = {name: {"long_name": text, "units": "1"} for name, text in texts.items()} | dataset.EFFORT_ATTRIBUTES
    return {name: (dataset.EFFORT_DIMENSIONS, values, told[name]) for name, values in (counts | numbers).items()}


def _reference_variables(agreement: list[list[list[float]]], floor: list[list[list[float]]]) -> dict[str, Any]:
    told = "difference of a reference from the first, by each measure"
    says = "what half a unit in the last place becomes: low, one in the launch; high, one in the depth of a contact"
    return {
        "agreement": (("stiffness", "source", "measure"), np.array(agreement), {"long_name": told, "units": "1"}),
        "floor": (("stiffness", "bound", "measure"), np.array(floor), {"long_name": says, "units": "1"}),
    }
