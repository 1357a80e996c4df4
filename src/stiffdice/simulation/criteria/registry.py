"""What counts as stable. A criterion is a module; one line registers it.

A criterion watches a run step by step and keeps the worst it has seen, its measure; it holds while the measure is at
most BASE + tolerance. It says with BY_DEFAULT whether it is asked where a study names none, with FOR_TURNING whether it
means anything for a cube that turns, with FAILURE which verdict a run gets that breaks it, and with SLOTS how many
numbers it has to remember, the measure first. They are zero at the launch unless it has a `start`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.compilation import njit, separate
from stiffdice.dynamics.state import TURNING, Array, Physics
from stiffdice.errors import InputError
from stiffdice.simulation import monitor
from stiffdice.simulation.criteria import apex, energy, finite, restitution, trajectory
from stiffdice.simulation.task import Member, Members, System

# In the order in which a run is asked; the numbers of the enum in files.
CRITERIA: dict[str, Any] = {
    "finite": finite,
    "energy": energy,
    "apex": apex,
    "restitution": restitution,
    "trajectory": trajectory,
}

# What all criteria remember of a run: one record a member. limits: the largest measures with which they still hold,
# infinite where a criterion is not to end the run; decided: the step that decided each, 0 for none yet. (In a record,
# because an array handed to compiled functions at every step would cost a reference count.)
MEMORY = np.dtype(
    [
        ("limits", np.float64, len(CRITERIA)),
        ("decided", np.int64, len(CRITERIA)),
        *((name, np.float64, criterion.SLOTS) for name, criterion in CRITERIA.items()),
    ]
)


def criteria_of(model: str) -> dict[str, Any]:
    """Return the criteria that mean something for a model."""
    return {name: part for name, part in CRITERIA.items() if part.FOR_TURNING or model not in TURNING}


def tolerances_of(model: str, asked: Mapping[str, float] | None = None) -> dict[str, float]:
    """Return the tolerance of each criterion that a run of this model is judged by, in the registry's order.

    asked: tolerances by criterion, of which those that mean something for the model are taken; None asks the default
    criteria at their default tolerances. Raises InputError for a name that is none.
    """
    known = criteria_of(model)
    if asked is None:
        return {name: part.TOLERANCE for name, part in known.items() if part.BY_DEFAULT}
    for name in asked:
        if name not in CRITERIA:
            raise InputError(f"criteria.{name}: unknown; allowed are {', '.join(CRITERIA)}")
    return {name: asked[name] for name in known if name in asked}


def holds(name: str, measure: npt.ArrayLike, tolerance: float) -> npt.NDArray[np.bool_]:
    """Return where a criterion holds, shape of `measure`; not-a-number never does."""
    return np.asarray(np.asarray(measure) <= CRITERIA[name].BASE + tolerance)


def values(memory: npt.NDArray[np.void]) -> dict[str, Array]:
    """Return each criterion's measure, shape (member,), by the measure's name, from an array of MEMORY records."""
    return {criterion.MEASURE: memory[name][..., 0].copy() for name, criterion in CRITERIA.items()}


def limits_of(tolerances: Mapping[str, float]) -> Array:
    """Return the largest measure with which each criterion still holds, shape (criterion,); infinite if not asked."""
    return np.array([part.BASE + tolerances[name] if name in tolerances else np.inf for name, part in CRITERIA.items()])


@njit
def open_of(memory: Any) -> int:
    """Return how many of the criteria that are to end a run are undecided; 1 if none is, so that it never ends."""
    limited, undecided = 0, 0
    for k in range(memory.limits.shape[0]):
        if memory.limits[k] < np.inf:
            limited += 1
            undecided += 1 if memory.decided[k] == 0 else 0
    return undecided if limited > 0 else 1


# Stands for the criteria after the last one, and for a `start` that a criterion has not.
_none = njit(lambda *_: 0)


def _chained(names: list[str]) -> tuple[Any, Any]:
    """Return compiled functions that let the criteria of these names begin to watch, and that show them a step.

    They are put together at import, because compiled code cannot loop over functions; called by its global name each
    costs nothing and leaves the kernel cacheable on disk.
    """
    if not names:
        return _none, _none
    name, k = names[0], list(CRITERIA).index(names[0])
    start_this, observe_this = getattr(CRITERIA[name], "start", _none), CRITERIA[name].observe
    start_others, observe_others = _chained(names[1:])

    @njit
    def start(memory: Any, sight: Any, system: Any, state: Any) -> None:
        start_this(memory[name], sight, system, state)
        start_others(memory, sight, system, state)

    @njit
    def observe(memory: Any, step: Any, sight: Any, system: Any, state: Any, reference: Any) -> int:
        measure, settled = observe_this(memory[name], sight, system, state, reference)
        newly = 0
        if memory.decided[k] == 0 and (settled or measure > memory.limits[k]):
            memory.decided[k] = step
            newly = 1 if memory.limits[k] < np.inf else 0
        return newly + observe_others(memory, step, sight, system, state, reference)

    return start, observe


_start, _observe = _chained(list(CRITERIA))


@njit(cache=True)
def start(system: System, members: Members) -> None:
    """Let monitor and criteria look at members that stand at their launch."""
    for m in range(len(members.ensemble)):
        state, sight = members.ensemble[m], members.sight[m]
        monitor.start(sight, system.physics, state)
        _start(members.memory[m], sight, system, state)


@separate("int64")
def observe(system: System, member: Member, step: int, flown: int) -> int:
    """Show a member's state after a step to monitor and criteria; return how many that have a limit this decides.

    A criterion is decided when it fails, or can fail no more. flown: steps of free flight that went by unseen before.
    """
    state, sight, memory, reference = member
    monitor.observe(sight, system.physics, state, step, flown)
    return int(_observe(memory, step, sight, system, state, reference))


@njit(cache=True)
def finish(physics: Physics, members: Members) -> None:
    """Let the energy look at the last state of each member."""
    for m in range(len(members.ensemble)):
        energy.finish(members.memory[m].energy, members.sight[m], physics, members.ensemble[m])
