"""Every way to run a problem, from one ladder of efforts: the schemes of the registry, and outside peers.

A scheme or an engine of fixed step goes from a step as long as its contact bears to shorter ones; a method that
controls its own error from a coarse tolerance to a fine one; an exact scheme has nothing to choose.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from stiffdice.dynamics import linear_theory
from stiffdice.experiments.measuring import Variable, quantity, states_of
from stiffdice.experiments.work_precision.problems import SAMPLES, Problem
from stiffdice.integrators import registry as schemes
from stiffdice.scene.scene import Scene
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.engines.registry import ENGINES, PEERS, SOLVERS, Path
from stiffdice.simulation.run import simulate

# Schemes whose error does not depend on the step, and that know flat landings only.
EXACT = frozenset({"exact"})
# Schemes that control their own error; steps are the intervals after which a state is known.
CONTROLLED = schemes.OWN_STEPS

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
    return [name for name in schemes.SCHEMES if not (problem.turns and name in EXACT)] + list(SOLVERS)


def chosen_from(problem: Problem, names: Sequence[str]) -> list[str]:
    """Return the methods of these names, or those that ALL stands for.

    Raises InputError for any other name, and for an engine that is not installed.
    """
    known = methods_for(problem)
    return known if list(names) == [ALL] else engines.chosen_from(names, [*known, *STEPPING])


def fixed_step(method: str) -> bool:
    """Return whether a method has a fixed step."""
    return not PEERS[method].own_steps if method in PEERS else method not in EXACT | CONTROLLED


def ladder(scene: Scene, method: str, per_decade: int, most_steps: float) -> Iterator[Effort]:
    """Yield efforts from the least on, so many per decade, without end but for tolerances, and steps up to a number."""
    if method in EXACT:
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
    run = simulate(
        scene,
        model=problem.model,
        scheme=method,
        steps=effort.steps,
        every=effort.steps // SAMPLES,
        leap=True,
        budget=budget,
    )
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
