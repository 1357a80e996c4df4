"""Methods that make a run: our schemes, and outside peers on our scenes, other people's integrators and engines.

A peer is a class; one line registers it. The class is an `adapter.Engine`. Its module imports the engine's package at
its top: it is itself imported by whom it is asked for only, and cannot be where the package is not installed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, States, start_of
from stiffdice.errors import InputError, NotInstalledError
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation.criteria.registry import observe, open_of
from stiffdice.simulation.engines.adapter import Engine, Scheme
from stiffdice.simulation.engines.numpy_loop import NumpyLoop
from stiffdice.simulation.task import Limits, Member, Members, System, Task, keep


class Peer(NamedTuple):
    """What loads the class, how the peer is called in a figure, what it needs, and who installs that.

    dearness: about how many force evaluations of ours take as long as one of its, most of it spent between languages.
    own_steps: whether it controls its own error, in steps of its own between two states.
    """

    load: Callable[[], type[Engine]]
    name: str
    needs: str = ""
    installs: str = "make install-engines"
    dearness: float = 100.0
    own_steps: bool = False


# By names that `code_digest` can follow.
def _mujoco() -> type[Engine]:
    from stiffdice.simulation.engines.mujoco import Mujoco

    return Mujoco


def _pybullet() -> type[Engine]:
    from stiffdice.simulation.engines.pybullet import Pybullet

    return Pybullet


def _drake() -> type[Engine]:
    from stiffdice.simulation.engines.drake import Drake

    return Drake


def _dart() -> type[Engine]:
    from stiffdice.simulation.engines.dart import Dart

    return Dart


def _octave() -> type[Engine]:
    from stiffdice.simulation.engines.octave import Octave

    return Octave


def _scipy(solver: str) -> type[Engine]:
    from stiffdice.simulation.engines import scipy_ivp

    return scipy_ivp.SOLVERS[solver]


def _peer_of_scipy(solver: str, name: str) -> Peer:
    return Peer(partial(_scipy, solver), f"SciPy {name}", "the package scipy", "make install", own_steps=True)


# What `simulator` may be besides stiffdice.
ENGINES: dict[str, Peer] = {
    "mujoco": Peer(_mujoco, "MuJoCo", "the package mujoco"),
    "pybullet": Peer(_pybullet, "PyBullet", "the package pybullet"),  # unmaintained: last release in January 2025
    "drake": Peer(_drake, "Drake", "the package drake", dearness=300),
    "dart": Peer(_dart, "DART", "the package dartpy", dearness=150),
    "scipy": _peer_of_scipy("lsoda", "LSODA"),
    "octave": Peer(_octave, "GNU Octave", "the program octave-cli", "your system's package manager", 3000),
    "numpy": Peer(lambda: NumpyLoop, "NumPy loop", "the package numpy", "make install", 500),
}

# Methods that control their own error and are tried beside the schemes, whatever else is asked.
SOLVERS = {f"scipy_{name.lower()}": _peer_of_scipy(name.lower(), name) for name in ("DOP853", "LSODA", "Radau")}

# Every method that is no scheme of ours, and every method.
PEERS: dict[str, Peer] = SOLVERS | ENGINES
METHODS = {
    name: Peer(partial(Scheme.of, name), name.replace("_", " "), dearness=1.0, own_steps=name in schemes.OWN_STEPS)
    for name in schemes.SCHEMES
} | PEERS


# Steps that an engine makes before anybody looks: few at first, as a run may be decided early, then ever more.
_FIRST, _MOST = 256, 8192


class Path(NamedTuple):
    """What came of a run: states at the launch and after equal parts of the duration, evaluations of the force.

    states: shape (sample + 1,); NaN where the run failed. computed: evaluations that were made; the others were taken
    at once.
    """

    states: States
    evaluations: int
    computed: int


@cache
def adapter_of(method: str, key: str = "simulator") -> type[Engine]:
    """Return the class whose instances are runs by a method.

    key: what names it, for the message. Raises InputError for an unknown method, NotInstalledError where what it stands
    on is not installed.
    """
    load, name, needs, installs, *_ = METHODS[validation.choice(key, method, METHODS)]
    try:
        return load()
    except ModuleNotFoundError:
        raise NotInstalledError(f"{key} = {method}: needs {needs}, which is not installed; {installs}") from None
    except ImportError as error:
        raise NotInstalledError(f"{key} = {method}: {name} cannot be loaded: {error}") from None


def check_fit(method: str, scene: Scene, model: str, key: str = "simulator") -> None:
    """Raise InputError where a method cannot represent a scene and model, or is not installed."""
    why = adapter_of(method, key).unfit(scene, model)
    if why is not None:
        raise InputError(f"{key} = {method}: {why}")


def chosen_from(names: Sequence[str], allowed: Sequence[str] = (*schemes.SCHEMES, *ENGINES)) -> list[str]:
    """Return these methods; raises InputError for one that is not allowed, or not installed."""
    for name in names:
        adapter_of(validation.choice("methods", name, allowed), "methods")
    return list(names)


def attributes(methods: Sequence[str]) -> dict[str, str]:
    """Return the attribute that says of which versions the engines and solvers among methods are."""
    found = dict.fromkeys(adapter_of(name, "methods").version() for name in methods if name in PEERS)
    return {"engine_versions": "; ".join(found)} if found else {}


def ready(
    method: str, scene: Scene, model: str, steps: int, samples: int, tolerance: float = math.nan
) -> Callable[[], Callable[[], Path]]:
    """Return a function that starts a run of the scene's duration, and returns another that makes it.

    Only the second is to be timed. steps: a multiple of `samples`; `samples` of them for a method that takes its own.
    samples: equal parts of the duration, after each of which the state is kept. tolerance [1]: relative, as the method
    understands it; not-a-number where it looks at none. Raises InputError for an unknown method or model, a scene that
    it cannot represent, where it is not installed, and for other steps.
    """
    validation.choice("model", model, MODELS)
    samples, steps = validation.count("samples", samples), validation.count("steps", steps)
    if steps % samples:
        raise InputError(f"steps = {steps}: allowed is a multiple of samples = {samples}")
    check_fit(method, scene, model, "method")
    launch, wanted = start_of(scene, model), schemes.TOLERANCE if math.isnan(tolerance) else tolerance

    def started() -> Callable[[], Path]:
        states = np.zeros(samples + 1, STATE)
        states[:1] = launch
        run = adapter_of(method)(scene, model, launch, scene.duration / steps, wanted, None)

        def made() -> Path:
            evaluations = run.advance(states[1:], steps // samples)
            return Path(states, evaluations, evaluations)

        return made

    return started


def march(task: Task, progress: Callable[[float], None] | None) -> None:
    """Let an engine run every member, one after another, and leave all as `simulate` does with its own steps.

    An engine advances by so many steps and tells the state after each; what watches a run and what judges it then looks
    at one state after another. So many at a time that memory stays small, however long the run.
    """
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
