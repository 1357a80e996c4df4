"""Work and precision: how far off every method is on one problem, against the force evaluations and the time it takes.

A problem (`problems.py`) is run on grounds from soft to stiff by every scheme and by outside peers, each at a ladder of
 A scheme or an engine of fixed step goes from a step as long as its contact bears to shorter ones; a method
that controls its own error from a coarse tolerance to a fine one; an exact scheme has nothing to choose. `measure`
compares runs with what is exact where that exists; other references tell by how much they differ from it. `time` takes
plain stepping.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import Array
from stiffdice.experiments.measuring import Variable, coordinates, numbers, quantity, result, states_of
from stiffdice.experiments.placement import contact_frequency, fall_speed, relaunched
from stiffdice.experiments.timing import interleaved, machine, seconds_of
from stiffdice.experiments.work_precision.problems import MEASURES, PROBLEMS, SAMPLES, Judge, Problem, scene_of
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import progress
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.engines.registry import ENGINES, PEERS, SOLVERS, Path
from stiffdice.simulation.run import simulate

# The scheme whose error does not depend on the step, and that knows flat landings only.
EXACT = "exact"

# Engines of fixed step.
STEPPING = [name for name, peer in ENGINES.items() if not peer.own_steps]

# Stands for every scheme that can run a problem, and the outside solvers; engines are named one by one.
ALL = "all"

# Tolerances of a method that controls its own error, ends of its ladder.
COARSE, FINE = 1e-2, 1e-12
# ωh of a flat landing where the ladder of a fixed step begins: where the explicit schemes are stable.
LONGEST = 1.5

# What every run on a ladder has: dimensions; meaning and unit.
GRID = ("stiffness", "method", "effort")
EFFORTS = {
    "steps": ("number of time steps, 0 where the method takes its own", "1"),
    "tolerance": ("tolerance of a method that controls its own error", "1"),
}
# Zero past a ladder's end, where other numbers are not-a-number.
_COUNTS = {"steps", "evaluations", "evaluations_computed"}


class Effort(NamedTuple):
    """One rung: so many steps (0: the method takes its own), at a tolerance (NaN: it looks at none)."""

    steps: int
    tolerance: float


def methods_for(problem: Problem) -> list[str]:
    """Return the names of all methods that ALL stands for: schemes, then outside solvers."""
    return [name for name in schemes.SCHEMES if not (problem.turns and name == EXACT)] + list(SOLVERS)


def chosen_from(problem: Problem, names: Sequence[str]) -> list[str]:
    """Return the methods of these names, or those that ALL stands for.

    Raises InputError for any other name, and for an engine that is not installed.
    """
    known = methods_for(problem)
    return known if list(names) == [ALL] else engines.chosen_from(names, [*known, *STEPPING])


def fixed_step(method: str) -> bool:
    """Return whether a method has a fixed step."""
    return not engines.METHODS[method].own_steps and method != EXACT


def ladder(scene: Scene, method: str, per_decade: int, most_steps: float) -> Iterator[Effort]:
    """Yield efforts from the least on, so many per decade, without end but for tolerances, and steps up to a number."""
    if method == EXACT:
        yield Effort(SAMPLES, math.nan)
        return
    if not fixed_step(method):
        steps = 0 if method in PEERS else SAMPLES
        count = round(per_decade * math.log10(COARSE / FINE)) + 1
        yield from (Effort(steps, float(f"{tolerance:.3g}")) for tolerance in np.geomspace(COARSE, FINE, count))
        return
    least, rung, before = linear_theory.steps_for(scene, LONGEST), 0, 0
    while (steps := SAMPLES * math.ceil(least * 10 ** (rung / per_decade) / SAMPLES)) <= most_steps:
        if steps > before:
            yield Effort(steps, math.nan)
        before, rung = steps, rung + 1


def plain(problem: Problem, scene: Scene, method: str, effort: Effort) -> Callable[[], Callable[[], Path]]:
    """Return a function that starts a run from the launch, and returns another that makes it step by step."""
    return engines.ready(method, scene, problem.model, effort.steps or SAMPLES, SAMPLES, effort.tolerance)


def path_of(problem: Problem, scene: Scene, method: str, effort: Effort, budget: int) -> Path:
    """Return what came of a run; a scheme's flights are taken at once, which agrees with stepping to round-off.

    budget: most steps to compute one by one; a run that needs more has not-a-number from there on.
    """
    if method in PEERS or not fixed_step(method):
        return plain(problem, scene, method, effort)()()
    model, steps = problem.model, effort.steps
    run = simulate(scene, model=model, scheme=method, steps=steps, every=steps // SAMPLES, leap=True, budget=budget)
    computed = int(run.evaluations[0])
    stages = computed / max(1, int(run.steps_computed[0]))
    return Path(states_of(run, SAMPLES), round(stages * effort.steps), computed)


def lag_time(scene: Scene, method: str, effort: Effort) -> float:
    """Return by how long [s] a method's velocity is behind its place."""
    return engines.adapter_of(method).LAG * scene.duration / effort.steps if fixed_step(method) else 0.0


def by_effort(
    found: Sequence[Sequence[Sequence[Mapping[str, float]]]], described: Mapping[str, tuple[str, str]]
) -> dict[str, Variable]:
    """Return numbers of the runs on each method's ladder as variables, dimensions stiffness, method, effort.

    found: by stiffness, method and effort, numbers by name. described: meaning and unit of those that are not EFFORTS.
    Past a ladder's end are zeros for counts, else not-a-numbers.
    """
    shape = len(found), len(found[0]), max(1, *(len(rungs) for row in found for rungs in row))
    variables = {}
    for name, text in {**EFFORTS, **described}.items():
        values = np.zeros(shape, np.int64) if name in _COUNTS else np.full(shape, np.nan)
        for i, k in np.ndindex(shape[:2]):
            values[i, k, : len(found[i][k])] = [rung[name] for rung in found[i][k]]
        variables[name] = quantity(GRID, values, *text)
    return variables


# What may be taken for right, best first; a peer at the least tolerance it has.
REFERENCES: dict[str, Effort] = {
    EXACT: Effort(SAMPLES, math.nan),
    **{name: Effort(SAMPLES, schemes.FINEST) for name in sorted(schemes.OWN_STEPS)},  # finer than any rung
    **{"scipy_dop853": Effort(0, 1e-13), "scipy_lsoda": Effort(0, FINE)},
}

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

    problem: flat-bounce, sliding-bounce or tumbling-throw. methods: names of schemes, of scipy_dop853, scipy_lsoda,
    scipy_radau, and of engines; `all` leaves engines out. stiffness [kg/s²]: of the ground. per_decade: efforts in a
    decade of steps or tolerance. steps: most of a fixed step's ladder. budget: most force evaluations of a run that are
    made, those taken at once not counted; a peer's ladder ends at its part of it (`Peer.dearness`). `agreement` has the
    difference of each reference from the first, `floor` what half a unit in the last place grows to: in the launch, and
    in the place during a contact, where it is one of the depth.
    Raises InputError for a number out of range, and for a scene in which the cube does not land and leave again.
    """
    chosen = PROBLEMS[validation.choice("problem", problem, PROBLEMS)]
    grounds = numbers("stiffness", stiffness, "kg/s²", above=0)
    per_decade, budget = validation.count("per_decade", per_decade), validation.count("budget", budget)
    steps = validation.number("steps", steps, "1", at_least=SAMPLES)
    scenes = [scene_of(chosen, scene, value) for value in grounds]
    names, fit = chosen_from(chosen, methods), methods_for(chosen)
    sources = [name for name in REFERENCES if name in fit]
    found, agreement, floor = [], [], []
    for ground in progress.each(scenes):
        paths = [path_of(chosen, ground, name, REFERENCES[name], budget) for name in sources]
        judge = Judge(chosen, ground, paths[0].states)
        agreement.append([list(judge.errors(path.states).values()) for path in paths])
        floor.append(_floors(chosen, ground, sources[0], judge, budget))
        found.append([_climbed(chosen, ground, name, judge, per_decade, steps, budget) for name in names])
    variables = coordinates(stiffness=grounds, method=names, source=sources, bound=["low", "high"], measure=MEASURES)
    variables |= by_effort(found, _DESCRIBED)
    variables["agreement"] = quantity(("stiffness", "source", "measure"), agreement, _AGREEMENT)
    variables["floor"] = quantity(("stiffness", "bound", "measure"), floor, _FLOOR)
    told = {"scene_note": _NOTE, "problem": problem, "samples": SAMPLES, "reference": sources[0]}
    title = f"Work and precision: {chosen.name}"
    return result(variables, title, scene, chosen.model, "method", __name__, **told, **engines.attributes(names))


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
    for effort in ladder(scene, method, per_decade, steps):
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
        errors = judge.errors(path.states, lag_time(scene, method, effort))
        counts = {"evaluations": path.evaluations, "evaluations_computed": path.computed}
        rungs.append(effort._asdict() | {f"{name}_error": error for name, error in errors.items()} | counts)
    return rungs


def _floors(problem: Problem, scene: Scene, source: str, judge: Judge, budget: int) -> Array:
    """Return for each measure what half a unit in the last place becomes, in the launch and in a contact.

    In the launch: each number of it is nudged alone, and the changes are added as if at random. In a contact an error
    of the place is one of the depth, which is only v/ω: relative to what the contact does it is ω r/v times as large.
    """
    radius = scene.cube.radius
    speed = fall_speed(scene, scene.launch.position[2] - judge.height)
    nudges = {"position": _NUDGE * radius, "velocity": _NUDGE * speed}
    if problem.turns:
        nudges["angular_momentum"] = _NUDGE * speed * scene.cube.moment_of_inertia / radius
    errors = []
    for key, nudge in nudges.items():
        value = np.array(scene.launch.spin if key == "angular_momentum" else getattr(scene.launch, key))
        for moved in (value + nudge * np.eye(3)).tolist():
            path = path_of(problem, relaunched(scene, **{key: tuple(moved)}), source, REFERENCES[source], budget)
            errors.append([*judge.errors(path.states).values()])
    grown = np.array(errors) / _NUDGE
    # A measure is a number itself, of the order of one.
    launch = np.fmax(1.0, np.sqrt((grown**2).sum(axis=0))) * _HALF_UNIT
    return np.array([launch, launch * max(1.0, contact_frequency(scene) * radius / speed)])


# A run on a ladder, to be timed: what makes it ready, off the clock.
Rung = tuple[Effort, Callable[[], Callable[[], object]]]

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
        climbed = [_timed(chosen, ground, name, per_decade, affordable) for name in names]
        times, _ = interleaved([start for rungs in climbed for _, start in rungs], rounds, affordable)
        taken = iter(times.tolist())
        found.append([[effort._asdict() | {"seconds": next(taken)} for effort, _ in rungs] for rungs in climbed])
        ends = zip(names, (rungs[-1] for rungs in found[-1]), strict=True)
        per_step.append([end["seconds"] / end["steps"] if fixed_step(name) else math.nan for name, end in ends])
    variables = coordinates(stiffness=grounds, method=names)
    variables |= by_effort(found, {"seconds": ("median wall time of a run", "s")})
    variables["seconds_per_step"] = quantity(GRID[:2], per_step, _PER_STEP, "s")
    told = {"problem": problem, "samples": SAMPLES, "rounds": rounds, **engines.attributes(names), **machine()}
    title = f"Time of work and precision: {chosen.name}"
    return result(variables, title, scene, chosen.model, "method", __name__, **told)


def _timed(problem: Problem, scene: Scene, method: str, per_decade: int, affordable: float) -> list[Rung]:
    """Return the rungs to be timed, called once each, the first twice."""
    rungs: list[Rung] = []
    took = 0.0
    for effort in ladder(scene, method, per_decade, math.inf):
        if fixed_step(method) and rungs and took * effort.steps / rungs[-1][0].steps > affordable:
            break
        start = plain(problem, scene, method, effort)
        if not rungs:  # it may compile
            start()()
        took = seconds_of(start())
        rungs.append((effort, start))
        if took > _END * affordable:
            break
    return rungs[-_RUNGS:] if fixed_step(method) else rungs
