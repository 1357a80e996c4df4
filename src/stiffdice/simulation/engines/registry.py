"""Outside peers: other people's integrators and engines on our scenes. An adapter is a module; one line registers it.

An adapter of an engine has what `Adapter` says, and imports the engine's package at its top: it is itself imported by
whom it is asked for only, and cannot be where the package is not installed.

SciPy's adapter has `prepare(scene, model, method, samples, tolerance)`, too, for each of SOLVERS. It returns a function
without arguments that makes the run and returns a `Path`: the states at the launch and after each of so many equal
parts of the duration.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, States, start_of
from stiffdice.errors import InputError, NotInstalledError
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation.fixed_step import Path


class Engine(Protocol):
    """One run of an engine, standing at its launch or where `advance` left it."""

    def advance(self, states: States, every: int) -> int:
        """Fill `states`, shape (K,), with the state after each `every` further steps; return the force evaluations.

        Where the run blows up, infinities and not-a-numbers from there on; never an exception.
        """


class Adapter(Protocol):
    """What the module of an engine has."""

    LAG: float  # [steps] by how many the velocity is behind the place, as schemes.LAGS
    SCHEME: str  # what its time stepping is called in files

    def unfit(self, scene: Scene, model: str) -> str | None:
        """Return in one sentence why the engine cannot represent a scene and model, or None if it can."""

    def versions(self) -> str:
        """Return the engine's name and version."""

    def start(self, scene: Scene, model: str, launch: States, h: float, tolerance: float) -> Engine:
        """Return a run from a launch, shape (1,), in steps of h [s]; tolerance [1]: for one that controls its error."""


class Peer(NamedTuple):
    """What imports the adapter, how the peer is called in a figure, what it needs, and who installs that.

    own_steps: whether it controls its own error, in steps of its own between two states.
    """

    load: Callable[[], Any]
    name: str
    needs: str
    installs: str = "make install-engines"
    own_steps: bool = False


class Solver(NamedTuple):
    """One method of SciPy's adapter."""

    peer: Peer
    method: str


# By names that `code_digest` can follow.
def _mujoco() -> Any:
    import stiffdice.simulation.engines.mujoco

    return stiffdice.simulation.engines.mujoco


def _pybullet() -> Any:
    import stiffdice.simulation.engines.pybullet

    return stiffdice.simulation.engines.pybullet


def _drake() -> Any:
    import stiffdice.simulation.engines.drake

    return stiffdice.simulation.engines.drake


def _scipy() -> Any:
    import stiffdice.simulation.engines.scipy_ivp

    return stiffdice.simulation.engines.scipy_ivp


def _octave() -> Any:
    import stiffdice.simulation.engines.octave

    return stiffdice.simulation.engines.octave


def _numpy() -> Any:
    import stiffdice.simulation.engines.numpy_loop

    return stiffdice.simulation.engines.numpy_loop


_SCIPY = Peer(_scipy, "SciPy LSODA", "the package scipy", "make install", own_steps=True)

# What `simulator` may be besides stiffdice.
ENGINES: dict[str, Peer] = {
    "mujoco": Peer(_mujoco, "MuJoCo", "the package mujoco"),
    "pybullet": Peer(_pybullet, "PyBullet", "the package pybullet"),
    "drake": Peer(_drake, "Drake", "the package drake"),
    "scipy": _SCIPY,
    "octave": Peer(_octave, "GNU Octave", "the program octave-cli", "your system's package manager"),
    "numpy": Peer(_numpy, "NumPy loop", "the package numpy", "make install"),
}

# Methods that control their own error and are tried beside the schemes, whatever else is asked.
SOLVERS: dict[str, Solver] = {
    "scipy_dop853": Solver(_SCIPY._replace(name="SciPy DOP853"), "dop853"),
    "scipy_lsoda": Solver(_SCIPY, "lsoda"),
    "scipy_radau": Solver(_SCIPY._replace(name="SciPy Radau"), "radau"),
}

# Every method that is no scheme of ours.
PEERS: dict[str, Peer] = {name: solver.peer for name, solver in SOLVERS.items()} | ENGINES


@cache
def adapter_of(peer: str, key: str = "simulator") -> Any:
    """Return the adapter of a peer.

    key: what names it, for the message. Raises InputError for an unknown peer, NotInstalledError where what it stands
    on is not installed.
    """
    load, name, needs, installs, _ = PEERS[validation.choice(key, peer, PEERS)]
    try:
        return load()
    except ModuleNotFoundError:
        raise NotInstalledError(f"{key} = {peer}: needs {needs}, which is not installed; {installs}") from None
    except ImportError as error:
        raise NotInstalledError(f"{key} = {peer}: {name} cannot be loaded: {error}") from None


def check_fit(peer: str, scene: Scene, model: str, key: str = "simulator") -> None:
    """Raise InputError where an engine cannot represent a scene and model, or is not installed."""
    why = adapter_of(peer, key).unfit(scene, model)
    if why is not None:
        raise InputError(f"{key} = {peer}: {why}")


def prepare(peer: str, scene: Scene, model: str, samples: int, tolerance: float, steps: int = 0) -> Callable[[], Path]:
    """Return a function that makes a peer's run, from the launch, every time it is called.

    tolerance [1]: relative, as the peer understands it; not-a-number where it looks at none. steps: a multiple of
    `samples`, for an engine of fixed step; 0 for a peer that takes its own.
    Raises InputError for an unknown peer, a scene that it cannot represent, and where it is not installed.
    """
    adapter = adapter_of(peer, "peer")
    validation.choice("model", model, MODELS)
    if peer in SOLVERS:
        run: Callable[[], Path] = adapter.prepare(scene, model, SOLVERS[peer].method, samples, tolerance)
        return run
    check_fit(peer, scene, model, "peer")
    every = max(1, steps // validation.count("samples", samples))
    if steps % samples:
        raise InputError(f"steps = {steps}: allowed is a multiple of samples = {samples}")
    return lambda: _path(adapter, scene, model, samples, every, tolerance)


def _path(adapter: Any, scene: Scene, model: str, samples: int, every: int, tolerance: float) -> Path:
    """Return what comes of a run of an engine, its start included."""
    states = np.zeros(samples + 1, STATE)
    states[:1] = start_of(scene, model)
    wanted = schemes.TOLERANCE if np.isnan(tolerance) else tolerance
    engine = adapter.start(scene, model, states[:1].copy(), scene.duration / (samples * every), wanted)
    evaluations = int(engine.advance(states[1:], every))
    return Path(states, evaluations, evaluations)
