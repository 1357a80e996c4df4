"""scene + model + scheme + steps → trajectory and verdict. Everything that runs the simulator runs this."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from stiffdice import checks, measures, schemes
from stiffdice.compiled import njit
from stiffdice.contact import LAWS
from stiffdice.energy import energies
from stiffdice.errors import InputError
from stiffdice.models import MODELS
from stiffdice.scene import Scene
from stiffdice.state import STATE, Array, Physics, States, physics_of, start_of
from stiffdice.verdict import judge

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

    measures: values by name, shape (member,). steps_done: int64 (member,), fewer than `steps` where the numbers left
    the range of doubles. verdict: int8 (member,), a `Verdict`. end: the last state, shape (member, ...).
    """

    scene: Scene
    model: str
    scheme: str
    steps: int
    measures: dict[str, Array]
    steps_done: npt.NDArray[np.int64]
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
    every: int | None = None,
    members: States | None = None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Run the simulator and return what happened.

    every: keep every K-th state, from the launch on; None keeps none. members: the launches of an ensemble, shape
    (member, ...) each; None runs the scene's own launch. progress: called with the fraction done, some times a second.

    Raises InputError for an unknown name, a step count or K out of range, and a trajectory too large to hold.
    """
    checks.choice("model", model, MODELS)
    checks.choice("scheme", scheme, schemes.SCHEMES)
    steps = checks.count("steps", steps)
    ensemble = start_of(scene, model) if members is None else members.copy()
    count = len(ensemble)
    if every is not None:
        every = checks.count("every", every, at_most=steps)
        if count != 1:
            raise InputError("every: a trajectory is kept of one run, not of an ensemble")
    samples = _room_for(steps, every)
    physics = physics_of(scene)
    tags = schemes.SCHEMES[scheme], MODELS[model], LAWS[scene.ground.contact]
    h = scene.duration / steps
    memory = np.zeros(count, measures.MEMORY)
    steps_done = np.zeros(count, np.int64)
    if every is not None:
        samples[0] = ensemble[0]

    stop, chunk = 0, steps if progress is None else 20_000
    while stop < steps:
        first, stop = stop, min(steps, stop + chunk)
        begun = time.perf_counter()
        _march(*tags, physics, ensemble, memory, steps_done, first, stop, h, every or 0, samples)
        if progress is not None:
            progress(stop / steps)
            chunk = int(chunk * min(10.0, max(0.1, 0.2 / max(1e-4, time.perf_counter() - begun)))) + 1

    found = measures.values(memory)
    finite = steps_done == steps
    return Run(
        scene,
        model,
        scheme,
        steps,
        found,
        steps_done,
        judge(model, found, finite, _sunk(physics, ensemble)),
        ensemble,
        None if every is None else _trajectory(scene, physics, samples, every, steps, int(steps_done[0])),
    )


def _room_for(steps: int, every: int | None) -> States:
    count = 0 if every is None else steps // every + 1
    if count > LARGEST_TRAJECTORY:
        raise InputError(
            f"every = {every}: would keep {count} samples ({count * STATE.itemsize / 1e9:.1f} GB); "
            f"allowed is {math.ceil(steps / LARGEST_TRAJECTORY)} or more"
        )
    return np.zeros(count, STATE)


@njit(cache=True)
def _march(
    scheme: Any,
    model: Any,
    law: Any,
    physics: Physics,
    ensemble: States,
    memory: npt.NDArray[np.void],
    steps_done: npt.NDArray[np.int64],
    start: int,
    stop: int,
    h: float,
    every: int,
    samples: States,
) -> None:
    """Advance every member from step `start` to step `stop`, watching each step and keeping every K-th."""
    for m in range(ensemble.shape[0]):
        if steps_done[m] != start:
            continue  # it left the numeric range in an earlier chunk
        state = ensemble[m]
        watch = memory[m]
        if start == 0:
            measures.start(watch, physics, state, h)
        until_kept = every - start % every if every > 0 else -1
        done = start
        for i in range(start + 1, stop + 1):
            schemes.step(scheme, model, law, physics, state, h)
            if not _is_finite(state):
                break
            done = i
            measures.observe(watch, physics, state, h)
            until_kept -= 1
            if until_kept == 0:
                until_kept = every
                samples[i // every] = state
        steps_done[m] = done


@njit
def _is_finite(state: Any) -> bool:
    """Return whether the state's places and momenta are all finite numbers."""
    total = 0.0
    for axis in range(3):
        total += abs(state.position[axis]) + abs(state.velocity[axis]) + abs(state.angular_momentum[axis])
        total += abs(state.node_offset[0, axis])  # a spin past range turns all nodes into not-a-number
    return total < math.inf


def _sunk(physics: Physics, ensemble: States) -> npt.NDArray[np.bool_]:
    """Return whether every node ended below the ground, shape (member,)."""
    normal = np.array([physics.nx, physics.ny, physics.nz])
    with np.errstate(all="ignore"):  # a run that blew up has infinite heights
        heights = (ensemble["position"][:, None, :] + ensemble["node_offset"]) @ normal
    return np.asarray((heights < 0).all(axis=1))


def _trajectory(scene: Scene, physics: Physics, samples: States, every: int, steps: int, steps_done: int) -> Trajectory:
    state = samples[: steps_done // every + 1]
    step = np.arange(len(state), dtype=np.int64) * every
    return Trajectory(step, step / steps * scene.duration, state, *energies(physics, state))
