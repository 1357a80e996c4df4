"""Outside peers: other people's integrators and engines on our scenes. A peer is a class; one line registers it.

The class is an `adapter.Engine`. Its module imports the engine's package at its top: it is itself imported by whom it
is asked for only, and cannot be where the package is not installed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

from stiffdice.errors import InputError, NotInstalledError
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation.engines.adapter import Engine


class Peer(NamedTuple):
    """What loads the class, how the peer is called in a figure, what it needs, and who installs that.

    dearness: about how many force evaluations of ours take as long as one of its, most of it spent between languages.
    own_steps: whether it controls its own error, in steps of its own between two states.
    """

    load: Callable[[], type[Engine]]
    name: str
    needs: str
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


def _octave() -> type[Engine]:
    from stiffdice.simulation.engines.octave import Octave

    return Octave


def _numpy() -> type[Engine]:
    from stiffdice.simulation.engines.numpy_loop import NumpyLoop

    return NumpyLoop


def _scipy(solver: str) -> Peer:
    """Return one of SciPy's solvers, by the name of its class."""

    def load() -> type[Engine]:
        from stiffdice.simulation.engines import scipy_ivp

        found: type[Engine] = getattr(scipy_ivp, solver)
        return found

    name = solver if solver == "Radau" else solver.upper()
    return Peer(load, f"SciPy {name}", "the package scipy", "make install", own_steps=True)


# What `simulator` may be besides stiffdice.
ENGINES: dict[str, Peer] = {
    "mujoco": Peer(_mujoco, "MuJoCo", "the package mujoco"),
    "pybullet": Peer(_pybullet, "PyBullet", "the package pybullet"),
    "drake": Peer(_drake, "Drake", "the package drake", dearness=300),
    "scipy": _scipy("Lsoda"),
    "octave": Peer(_octave, "GNU Octave", "the program octave-cli", "your system's package manager", 3000),
    "numpy": Peer(_numpy, "NumPy loop", "the package numpy", "make install", 500),
}

# Methods that control their own error and are tried beside the schemes, whatever else is asked.
SOLVERS: dict[str, Peer] = {
    "scipy_dop853": _scipy("Dop853"),
    "scipy_lsoda": _scipy("Lsoda"),
    "scipy_radau": _scipy("Radau"),
}

# Every method that is no scheme of ours.
PEERS: dict[str, Peer] = SOLVERS | ENGINES


@cache
def adapter_of(peer: str, key: str = "simulator") -> type[Engine]:
    """Return the class whose instances are runs of a peer.

    key: what names it, for the message. Raises InputError for an unknown peer, NotInstalledError where what it stands
    on is not installed.
    """
    load, name, needs, installs, *_ = PEERS[validation.choice(key, peer, PEERS)]
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
