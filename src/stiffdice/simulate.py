"""scene + model + scheme + steps → trajectory and verdict. Everything that runs the simulator runs this."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice import checks, phases, requirement, schemes, watch
from stiffdice.compiled import njit
from stiffdice.contact import LAWS
from stiffdice.criteria import MEMORY, limits_of, open_of, tolerances_of, values
from stiffdice.criteria import observe as criteria_observe
from stiffdice.criteria import start as criteria_start
from stiffdice.energy import energies
from stiffdice.errors import InputError
from stiffdice.flight import free_steps
from stiffdice.judge import judge
from stiffdice.models import MODELS
from stiffdice.reference import none
from stiffdice.scene import Scene
from stiffdice.state import STATE, Array, Ensemble, Physics, States, physics_of, start_of
from stiffdice.verdict import Verdict
from stiffdice.watch import SIGHT

LARGEST_TRAJECTORY = 5_000_000  # samples kept in memory for one run: 1.4 GB


@dataclass(frozen=True)
class Trajectory:
    """Every K-th state of one run.

    step, time [s], state (STATE records) and energies [J]: shape (time,) each.
    `energy_paper` is kinetic + m g z, the listings' energy; the springs' elastic energy comes on top.
    """

    step: npt.NDArray[np.int64]
    time: Array
    state: States
    kinetic_energy: Array
    potential_energy: Array
    elastic_energy: Array

    @property
    def energy_paper(self) -> Array:
        """Kinetic and potential energy as the listings add them [J]."""
        with np.errstate(invalid="ignore"):  # inf − inf, where a run blew up
            return self.kinetic_energy + self.potential_energy


@dataclass(frozen=True)
class Run:
    """One run, or an ensemble of them.

    model: the one computed; model_reason: why, where `auto` was asked. tolerances: of the criteria the run was asked.
    measures: values by name, shape (member,). steps_done: int64 (member,): fewer than `steps` where the run was
    stopped, all being decided, or left the range of doubles. decided: int64 (member, criterion), the step that decided
    a criterion, in the registry's order; 0 if none did before the end. steps_computed: int64 (member,), those not taken
    at once. evaluations: int64 (member,), of the force. tolerance [1]: of the error, for a scheme that controls its
    own. verdict: int8 (member,), a `Verdict`. end: the last state, shape (member, ...).
    """

    scene: Scene
    model: str
    model_reason: str
    scheme: str
    steps: int
    tolerance: float
    tolerances: dict[str, float]
    measures: dict[str, Array]
    touchdown_phase: Array
    steps_done: npt.NDArray[np.int64]
    decided: npt.NDArray[np.int64]
    steps_computed: npt.NDArray[np.int64]
    evaluations: npt.NDArray[np.int64]
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
    scheme: str = "symplectic_euler",
    steps: int = 10_000,
    tolerance: float = schemes.TOLERANCE,
    every: int | None = None,
    leap: bool = False,
    members: Ensemble | None = None,
    criteria: Mapping[str, float] | None = None,
    stop: Mapping[str, float] | None = None,
    references: npt.NDArray[np.void] | None = None,
    budget: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Run the simulator and return what happened.

    model: `auto` takes the least that is exact for the scene (`requirement.py`). tolerance [1]: of the error, relative
    to the motion, for a scheme that controls its own; `steps` are then the intervals after which a state is known.
    every: keep every K-th state, from the launch on. leap: take many steps at once where their motion is known
    (`flight.py`, `phases.py`), which agrees with stepping to round-off; where no state is kept that is done anyway.
    members: the launches of an ensemble; None runs the scene's own launch. criteria: tolerances of those that the
    verdict asks; None asks the default ones. stop: end a run as soon as all of these criteria are decided at these
    tolerances. references: what `trajectory` compares with, one for all or one for each member (`reference.make`).
    budget: most steps to compute one by one; a run that needs more ends undecided. progress: called with the fraction
    done, some times a second.

    Raises InputError for an unknown name, a step count or K out of range, a model that the scene or the scheme does not
    allow, `auto` for an ensemble, and a trajectory too large to hold.
    """
    checks.choice("scheme", scheme, schemes.SCHEMES)
    steps = checks.count("steps", steps)
    if model == requirement.AUTO and members is not None:
        raise InputError("model = auto: is chosen for the scene's own launch; an ensemble needs the name of a model")
    model, model_reason = requirement.chosen(model, [scene], scene.duration / steps)
    schemes.check_fit(scheme, scene, model)
    tolerance = checks.number("tolerance", tolerance, "1", above=0)
    if not schemes.FINEST <= tolerance <= schemes.COARSEST:
        raise InputError(
            f"tolerance = {tolerance:g}: allowed is a number from {schemes.FINEST:g} to {schemes.COARSEST:g}"
        )
    tolerances = tolerances_of(model, criteria)
    alone = Ensemble(start_of(scene, model), np.zeros(1))
    launches, late = alone if members is None else members
    ensemble = launches.copy()
    count = len(ensemble)
    if every is not None:
        every = checks.count("every", every, at_most=steps)
        if count != 1:
            raise InputError("every: a trajectory is kept of one run, not of an ensemble")
    samples = _room_for(steps, every)
    physics = physics_of(scene)
    tags = schemes.SCHEMES[scheme], MODELS[model], LAWS[scene.ground.contact]
    h = scene.duration / steps
    most = steps if budget is None else budget
    watched = Watched(np.zeros(count, MEMORY), np.zeros(count, SIGHT), *np.zeros((3, count), np.int64))
    watched.memory["limits"] = limits_of({} if stop is None else stop)
    if every is not None:
        samples[0] = ensemble[0]
    _begin(physics, ensemble, watched.memory, watched.sight, h, steps, late, schemes.LAGS[scheme])

    reached, chunk, longest = 0, 20_000, steps
    if scheme in schemes.OWN_STEPS:  # of which one may take as long as all before
        chunk = longest = max(1, min(100, steps // 200))
    if progress is None:
        chunk = steps
    while reached < steps:
        begun = time.perf_counter()
        reached = min(steps, reached + chunk)
        _march(
            *tags,
            physics,
            ensemble,
            watched.memory,
            watched.sight,
            watched.steps_done,
            watched.steps_computed,
            watched.evaluations,
            none() if references is None else references,
            reached,
            steps,
            h,
            tolerance,
            most,
            every or 0,
            leap or every is None,
            samples,
        )
        if progress is not None:
            progress(reached / steps)
            wanted = chunk * min(10.0, max(0.1, 0.2 / max(1e-4, time.perf_counter() - begun)))
            chunk = min(longest, int(wanted) + 1)

    found = values(watched.memory)
    endings = {
        Verdict.SANK: _sunk(physics, ensemble, watched),
        Verdict.STALLED: _stalled(launches, h),
        Verdict.UNDECIDED: (watched.steps_done < steps) & (watched.steps_computed >= most),
    }
    return Run(
        scene,
        model,
        model_reason,
        scheme,
        steps,
        tolerance,
        tolerances,
        found,
        watched.sight["touchdown_phase"].copy(),
        watched.steps_done,
        watched.memory["decided"].copy(),
        watched.steps_computed,
        watched.evaluations,
        judge(tolerances, found, endings),
        ensemble,
        None if every is None else _trajectory(scene, physics, samples, every, steps, int(watched.steps_done[0])),
    )


class Watched(NamedTuple):
    """What a kernel keeps of each member besides its state; first dimension member."""

    memory: npt.NDArray[np.void]
    sight: npt.NDArray[np.void]
    steps_done: npt.NDArray[np.int64]
    steps_computed: npt.NDArray[np.int64]
    evaluations: npt.NDArray[np.int64]


def _room_for(steps: int, every: int | None) -> States:
    count = 0 if every is None else steps // every + 1
    if count > LARGEST_TRAJECTORY:
        raise InputError(
            f"every = {every}: would keep {count} samples ({count * STATE.itemsize / 1e9:.1f} GB); "
            f"allowed is {math.ceil(steps / LARGEST_TRAJECTORY)} or more"
        )
    return np.zeros(count, STATE)


@njit(cache=True)
def _begin(
    physics: Physics,
    ensemble: States,
    memory: npt.NDArray[np.void],
    sight: npt.NDArray[np.void],
    h: float,
    steps: int,
    late: Array,
    lag: float,
) -> None:
    """Let everything that watches a run look at its launch."""
    for m in range(ensemble.shape[0]):
        watch.start(sight[m], physics, ensemble[m], h, late[m], lag)
        sight[m].steps = steps
        criteria_start(memory[m], sight[m], physics, ensemble[m])


@njit(cache=True)
def _march(
    scheme: Any,
    model: Any,
    law: Any,
    physics: Physics,
    ensemble: States,
    memory: npt.NDArray[np.void],
    sight: npt.NDArray[np.void],
    steps_done: npt.NDArray[np.int64],
    steps_computed: npt.NDArray[np.int64],
    evaluations: npt.NDArray[np.int64],
    references: npt.NDArray[np.void],
    stop: int,
    steps: int,
    h: float,
    tolerance: float,
    budget: int,
    every: int,
    leap: bool,
    samples: States,
) -> None:
    """Advance every member to step `stop`, watching each step and keeping every K-th.

    leap: motion that is known is taken at once, up to the next sample; past `stop` if it lasts longer, so that where to
    stop changes nothing.
    """
    for m in range(ensemble.shape[0]):
        state, seen, remembered = ensemble[m], sight[m], memory[m]
        reference = references[m % references.shape[0]]
        undecided = open_of(remembered)
        done = steps_done[m]
        kept = (done // every + 1) * every if every > 0 else -1  # the step to keep next
        while done < stop and undecided > 0 and remembered.finite[0] == 0.0:
            flown = skipped = 0
            if leap:
                most = min(kept, steps) - done if every > 0 else steps - done
                if reference.horizon >= seen.time:  # it is compared at least as often as the reference is known
                    most = min(most, 1 + int(reference.spacing / h))
                flown = free_steps(model, law, physics, state, seen, most)
                if flown == 0 and steps_computed[m] < budget:
                    skipped = phases.skip(scheme, model, law, physics, state, seen, most)
            if flown > 0:
                schemes.flight(scheme, model, physics, state, h, flown)
            elif steps_computed[m] >= budget:
                break
            else:
                evaluations[m] += schemes.step(scheme, model, law, physics, state, h, tolerance)
                steps_computed[m] += 1
            step = done + skipped + max(1, flown)
            watch.observe(seen, physics, state, step, flown)
            undecided -= criteria_observe(remembered, step, seen, law, physics, state, reference)
            if remembered.finite[0] > 0.0:
                break
            done = step
            if done == kept:
                samples[step // every] = state
                kept += every
        steps_done[m] = done


def _sunk(physics: Physics, ensemble: States, watched: Watched) -> npt.NDArray[np.bool_]:
    """Return whether every node ended below the ground, shape (member,), and not just in the middle of a bounce.

    A bounce ends, if the cube rests with its upper nodes out, and is no deeper than the energy of the launch takes it.
    """
    normal = np.array([physics.nx, physics.ny, physics.nz])
    with np.errstate(all="ignore"):  # a run that blew up has infinite heights
        heights = (ensemble["position"][:, None, :] + ensemble["node_offset"]) @ normal
        fall = np.sqrt(watched.memory["energy"][:, 2] / (2 * physics.stiffness))
    sag = watched.sight["sag"]
    bounces = (sag < physics.side) & (-heights.min(axis=1) <= 2 * sag + fall)
    return np.asarray((heights < 0).all(axis=1) & ~bounces)


def _stalled(launches: States, h: float) -> npt.NDArray[np.bool_]:
    """Return whether a step at the speed of the launch is lost in round-off of the place, shape (member,)."""
    place, speed = launches["position"], launches["velocity"]
    with np.errstate(over="ignore"):  # launches may be anything
        return np.asarray(((speed != 0) & (place + h * speed == place)).any(axis=1))


def _trajectory(scene: Scene, physics: Physics, samples: States, every: int, steps: int, steps_done: int) -> Trajectory:
    state = samples[: steps_done // every + 1]
    step = np.arange(len(state), dtype=np.int64) * every
    return Trajectory(step, step / steps * scene.duration, state, *energies(physics, state))
