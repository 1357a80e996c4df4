"""scene + model + scheme + steps → trajectory and verdict. Everything that runs the simulator runs this."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics import model_selection
from stiffdice.dynamics.compilation import compile_together, njit
from stiffdice.dynamics.energy import energies, energies_at_places, fill_energies, kinetic_at_place
from stiffdice.dynamics.state import Array, Ensemble, States, start_of
from stiffdice.errors import InputError
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import backend, batch_loop, fast_forward
from stiffdice.simulation.backend import Setup
from stiffdice.simulation.criteria import judge
from stiffdice.simulation.criteria.apex import default_hop_height
from stiffdice.simulation.criteria.registry import MEMORY, finish, limits_of, observe, open_of, tolerances_of, values
from stiffdice.simulation.criteria.registry import start as criteria_start
from stiffdice.simulation.criteria.trajectory import empty
from stiffdice.simulation.monitor import SIGHT
from stiffdice.simulation.task import Limits, Member, Members, System, Task, keep, room_for, until_kept

# Steps and force evaluations, about, after which compiled code returns, to see signals and tell progress: a twentieth
# of a second.
_WORK = 200_000


@dataclass(frozen=True)
class Trajectory:
    """Every K-th state of one run.

    All arrays have shape (time,). step: how many steps were done. time [s]: since the launch. state: records of
    position [m], velocity [m/s], angular_momentum [kg m²/s], angular_velocity [rad/s] and node_offset [m], shape (3,),
    the last (8, 3). kinetic_energy [J]: of translation and rotation. potential_energy [J]: m g z of the centre.
    elastic_energy [J]: in the ground's springs. mechanical_energy [J]: all three with the velocity at the time of the
    place; None where the force is an engine's own.
    """

    step: npt.NDArray[np.int64]
    time: Array
    state: States
    kinetic_energy: Array
    potential_energy: Array
    elastic_energy: Array
    mechanical_energy: Array | None

    @property
    def energy_paper(self) -> Array:
        """Kinetic and potential energy as the listings add them [J]."""
        with np.errstate(invalid="ignore"):  # inf − inf, where a run blew up
            return self.kinetic_energy + self.potential_energy


@dataclass(frozen=True)
class Run:
    """One run, or an ensemble of them.

    scene: the problem. model: the one computed. model_reason: why, where `auto` was asked. simulator: what made the
    run. simulator_version: its name and version. scheme: of the time steps. steps: their number to the scene's
    duration. tolerance [1]: of the error, for a scheme that controls its own. tolerances [1]: by criterion, of those
    the run was asked. hop_height [m]: below which the criterion apex judges no rebound. measures [1]: values by name,
    shape (member,). touchdown_phase [1]: of the first touch-down within its step, shape (member,). steps_done: int64
    (member,), fewer than `steps` where the run was stopped, all being decided, or left the range of doubles. decided:
    int64 (member, criterion), the step that decided a criterion, in the registry's order; 0 if none did before the end.
    steps_computed: int64 (member,), those not taken at once. evaluations: int64 (member,), of the force. ending: int8
    (member,), the `Verdict` whatever the run was asked. verdict: int8 (member,), the `Verdict` by the criteria asked.
    end: the last states, STATE records of shape (member,), in SI units. trajectory: None if no state was kept.
    """

    scene: Scene
    model: str
    model_reason: str
    simulator: str
    simulator_version: str
    scheme: str
    steps: int
    tolerance: float
    tolerances: dict[str, float]
    hop_height: float
    measures: dict[str, Array]
    touchdown_phase: Array
    steps_done: npt.NDArray[np.int64]
    decided: npt.NDArray[np.int64]
    steps_computed: npt.NDArray[np.int64]
    evaluations: npt.NDArray[np.int64]
    ending: npt.NDArray[np.int8]
    verdict: npt.NDArray[np.int8]
    end: States
    trajectory: Trajectory | None


def default_every(steps: int) -> int:
    """Return the K that keeps at most 10,000 samples of a run."""
    return max(1, math.ceil(steps / 10_000))


def simulate(
    scene: Scene,
    *,
    model: str = "tumbling",
    simulator: str = backend.OURS,
    scheme: str | None = None,
    steps: int = 10_000,
    tolerance: float = schemes.TOLERANCE,
    every: int | None = None,
    leap: bool | None = None,
    members: Ensemble | None = None,
    criteria: Mapping[str, float] | None = None,
    stop: Mapping[str, float] | None = None,
    references: npt.NDArray[np.void] | None = None,
    hop_height: float | None = None,
    budget: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Run a scene and return the verdict, the measures and, if asked, the trajectory.

    scene: the problem. model: vertical, sliding, tumbling, flying, or auto: the least that is exact for the scene.
    simulator: stiffdice, or an engine that is installed (docs/explanation/engines.md), which takes every step, one
    member after another. scheme: None takes symplectic_euler, or an engine's own. steps: number of time steps to the
    scene's duration. tolerance [1]: of the error, relative to the motion, for a scheme that controls its own; `steps`
    are then the intervals after which a state is known. every: keep every K-th state, from the launch on; None keeps
    none. leap: take many steps at once where their motion is known, which agrees with stepping as listed to round-off;
    None does so where no state is kept. members: the launches of an ensemble; None runs the scene's own launch.
    criteria [1]: tolerances of those that the verdict asks, by name; None asks the default ones. stop [1]: end a run as
    soon as all of these criteria are decided at these tolerances. references: what the criterion trajectory compares
    with, one for all or one for each member (`reference_run.references`). hop_height [m]: rebounds that stay lower are
    not judged by the criterion apex; None takes a tenth of the cube's radius. budget: most steps to compute one by one,
    or about the most force evaluations of a scheme or an engine that takes its own steps; a run that needs more ends
    undecided; None is all steps, or 10⁷ evaluations. progress: called with the fraction done, some times a second.

    Raises InputError for an unknown name, a step count or K out of range, a model that the scene, the scheme or the
    engine does not allow, an engine that is not installed, `auto` for an ensemble, and a trajectory too large to hold.
    """
    if model == model_selection.AUTO and members is not None:
        raise InputError("model = auto: is chosen for the scene's own launch; an ensemble needs the name of a model")
    setup = backend.setup_of(scene, model, simulator, scheme, steps)
    tolerances = tolerances_of(setup.model, criteria)
    task = _task(setup, tolerance, every, members, stop, references, hop_height, budget)
    leaping = leap or (leap is None and every is None)
    if setup.ours and not criteria_start.is_compiled:  # later runs of a process mostly need no other kernels
        _compile(task, leaping)
    criteria_start(task.system, task.members)
    _advance(task, leaping, progress)
    return _judged(task, tolerances)


def _task(
    setup: Setup,
    tolerance: float,
    every: int | None,
    members: Ensemble | None,
    stop: Mapping[str, float] | None,
    references: npt.NDArray[np.void] | None,
    hop_height: float | None,
    budget: int | None,
) -> Task:
    """Return what `simulate` was asked, checked, every member watched and at its launch."""
    number = validation.number("tolerance", tolerance, "1", above=0)
    if not schemes.FINEST <= number <= schemes.COARSEST:
        raise InputError(f"tolerance = {number:g}: allowed is a number from {schemes.FINEST:g} to {schemes.COARSEST:g}")
    if hop_height is None:
        hop_height = default_hop_height(setup.scene)
    hop_height = validation.number("hop_height", hop_height, "m", at_least=0)
    launches, late = members or Ensemble(start_of(setup.scene, setup.model), np.zeros(1))
    count = len(launches)
    if every is not None:
        every = validation.count("every", every, at_most=setup.steps)
        if count != 1:
            raise InputError("every: a trajectory is kept of one run, not of an ensemble")
    samples, sight, memory = room_for(setup.steps, every), np.zeros(count, SIGHT), np.zeros(count, MEMORY)
    samples[:1] = launches[:1]
    sight["step_size"], sight["steps"], sight["late"] = setup.step_size, setup.steps, late
    sight["lag"], sight["hop_height"] = setup.lag, hop_height
    memory["limits"] = limits_of(stop or {})
    references = empty() if references is None else references
    watched = Members(launches.copy(), sight, memory, references, samples, *np.zeros((3, count), np.int64))
    limits = Limits(setup.steps, setup.budget if budget is None else budget, every or 0, number)
    return Task(setup, limits, hop_height, launches, watched)


def _compile(task: Task, leaping: bool) -> None:
    """Compile all that the run will call."""
    system, members = task.system, task.members
    batched = batch_loop.march_of(task) if leaping else None
    member = Member(members.ensemble[0], members.sight[0], members.memory[0], members.references[0])
    called = (observe, (system, member, 0, 0)), (kinetic_at_place, (*system, member.state, 0.0))
    # The process that compiles the kinetic energy, and with it the force, takes `_march` next, which has that, too.
    march = (batched, *called) if batched else (*called, (_march, _arguments(task, leaping)))
    watch = (criteria_start, (system, members)), (finish, (system.physics, members))
    states = members.samples
    keep = fill_energies, (*system, states, 0.0, np.empty((4, 0)))
    compile_together(*march, *watch, *([keep] if task.limits.every else ()))


def _advance(task: Task, leaping: bool, progress: Callable[[float], None] | None) -> None:
    """Advance every member to its end; leaping: take motion that is known at once."""
    setup = task.setup
    if not setup.ours:
        backend.driver().march(task, progress)
        return

    arguments = _arguments(task, leaping)

    def stepwise() -> bool:
        goes_on: bool = _march(*arguments)
        return goes_on

    advance = (batch_loop.start(task) if leaping else None) or stepwise
    goes_on = True
    while goes_on:  # between two calls of compiled code, Python sees signals
        goes_on = advance()
        if progress is not None:
            progress(task.members.fraction(setup.steps, setup.step_size))


def _arguments(task: Task, leaping: bool) -> tuple[Any, ...]:
    """Return what `_march` takes."""
    return schemes.SCHEMES[task.setup.scheme], task.system, task.members, task.limits, True if leaping else None


def _judged(task: Task, tolerances: dict[str, float]) -> Run:
    """Return the run that is over, with its verdicts."""
    setup, members = task.setup, task.members
    finish(task.system.physics, members)
    measures = values(members.memory)
    ended = judge.ending(measures, judge.endings_of(task))
    return Run(
        **setup._asdict(),
        simulator_version=backend.version_of(setup.simulator),
        tolerance=task.limits.tolerance,
        tolerances=tolerances,
        hop_height=task.hop_height,
        measures=measures,
        touchdown_phase=members.sight["touchdown_phase"].copy(),
        steps_done=members.steps_done,
        decided=members.memory["decided"].copy(),
        steps_computed=members.steps_computed,
        evaluations=members.evaluations,
        ending=ended,
        verdict=judge.judge(tolerances, measures, ended),
        end=members.ensemble,
        trajectory=_trajectory(task) if task.limits.every else None,
    )


def _trajectory(task: Task) -> Trajectory:
    setup, system, every = task.setup, task.system, task.limits.every
    state = task.members.samples[: int(task.members.steps_done[0]) // every + 1]
    step = np.arange(len(state), dtype=np.int64) * every
    time = step / setup.steps * setup.scene.duration
    whole: Array | None
    if setup.ours:
        kinetic, potential, elastic, whole = energies_at_places(*system, state, setup.lag * setup.step_size)
    else:
        (kinetic, potential, elastic), whole = energies(system.physics, state), None
    return Trajectory(step, time, state, kinetic, potential, elastic, whole)


@njit(cache=True)
def _march(scheme: Any, system: System, members: Members, limits: Limits, leap: Any) -> bool:
    """Advance one member after another, watching each step and keeping every K-th; return whether there is more to do.

    It ends after _WORK, so that Python can see a signal; where it ends changes nothing. leap: whether motion that is
    known is taken at once, up to the next sample; None if not, which leaves all of that out of what is compiled.
    """
    work = 0.0
    for m in range(len(members.ensemble)):
        state, sight, memory = members.ensemble[m], members.sight[m], members.memory[m]
        member = Member(state, sight, memory, members.references[m % len(members.references)])
        undecided, done = open_of(memory), members.steps_done[m]
        kept = until_kept(limits, done)  # the step to keep next
        while done < limits.steps and undecided > 0 and memory.finite[0] == 0.0:
            if work >= _WORK:
                members.steps_done[m] = done
                return True
            before = sight.work
            left = limits.budget - max(members.steps_computed[m], int(before))
            if leap is not None and sight.pending == 0.0:
                taken, flown, computed, evaluated = _leap(scheme, system, member, kept - done, left, limits.tolerance)
            elif left > 0:
                taken, evaluated = _one(scheme, system, member, limits.tolerance)
                flown, computed = 0, taken
            else:
                break
            work += 1 + max(evaluated, sight.work - before)
            members.steps_computed[m] += computed
            members.evaluations[m] += evaluated
            if sight.pending > 0.0:
                continue
            if taken == 0:
                break
            undecided -= observe(system, member, done + taken, flown)
            if memory.finite[0] > 0.0:
                done = done + taken - 1 if computed > 0 else done
                break
            done += taken
            if done == kept:
                keep(limits, members.samples, state, done)
                kept = until_kept(limits, done)
        members.steps_done[m] = done
    return False


@njit
def _one(scheme: Any, system: System, member: Member, tolerance: float) -> tuple[int, int]:
    """Take a step, or a part of it; return the steps done and force evaluations."""
    state, sight = member.state, member.sight
    return schemes.one(scheme, system.model, system.physics, state, sight, tolerance)


@njit
def _leap(
    scheme: Any, system: System, member: Member, most: int, left: int, tolerance: float
) -> tuple[int, int, int, int]:
    """Take steps up to the next that must be seen; return how many, in free flight, computed, and force evaluations.

    most: steps at most. left: those that may be computed; where that is none and no other is known, none is taken.
    """
    most = fast_forward.compared(member, most)
    flown = fast_forward.fly(scheme, system, member, most)
    if flown > 0 or left <= 0:
        return flown, flown, 0, 0
    skipped = fast_forward.skip(scheme, system, member, most)
    taken, evaluated = _one(scheme, system, member, tolerance)
    return skipped + taken, 0, taken, evaluated
