"""A run that an outside engine makes, watched step by step as one of our own.

An engine advances by so many steps and tells the state after each; what watches a run and what judges it then looks at
one state after another. So many at a time that memory stays small, however long the run.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.state import STATE, States
from stiffdice.simulation.criteria.registry import observe, open_of
from stiffdice.simulation.engines.registry import ENGINES, adapter_of, check_fit
from stiffdice.simulation.task import Limits, Member, Members, System, Task, keep

__all__ = ["ENGINES", "adapter_of", "check_fit", "march"]  # what `backend.py` loads

# Steps that an engine makes before anybody looks: few at first, as a run may be decided early, then ever more.
_FIRST, _MOST = 256, 8192


def march(task: Task, progress: Callable[[float], None] | None) -> None:
    """Let an engine run every member, one after another, and leave all as `simulate` does with its own steps."""
    setup, members, (steps, budget, _, tolerance) = task.setup, task.members, task.limits
    engine_of, own = adapter_of(setup.simulator), ENGINES[setup.simulator].own_steps
    count, most = len(members.ensemble), steps if own else min(steps, budget)
    for m in range(count):
        engine = engine_of(setup.scene, setup.model, task.launches[m : m + 1], setup.step_size, tolerance, budget)
        asked, chunk, goes_on = 0, _FIRST, True
        while asked < most and goes_on:
            states = np.zeros(min(chunk, most - asked), STATE)
            members.evaluations[m] += engine.advance(states, 1)
            asked += len(states)
            if own and members.evaluations[m] >= budget:
                ended = ~np.isfinite(states["position"]).all(axis=1)
                states, goes_on = states[: ended.argmax() if ended.any() else None], False
                members.sight["work"][m] = members.evaluations[m]
            goes_on &= _look(task.system, task.limits, members, m, states)
            chunk = min(_MOST, 2 * chunk)
            if progress is not None:
                progress((m + members.steps_done[m] / most) / count)


@njit(cache=True)
def _look(system: System, limits: Limits, members: Members, m: int, states: States) -> bool:
    """Show states to all that watch member m, and return whether it goes on: neither decided nor out of range."""
    state, sight, memory = members.ensemble[m], members.sight[m], members.memory[m]
    member = Member(state, sight, memory, members.references[m % len(members.references)])
    undecided = open_of(memory)
    for k in range(len(states)):
        members.ensemble[m] = states[k]
        step = members.steps_computed[m] = members.steps_done[m] + 1
        undecided -= observe(system, member, step, 0)
        if memory.finite[0] > 0.0:
            return False
        members.steps_done[m] = step
        keep(limits, members.samples, state, step)
        if undecided <= 0:
            return False
    return True
