"""Outside peers: other people's integrators and engines on our scenes. An adapter is a module; one line registers it.

An adapter has `prepare(scene, model, method, samples, tolerance)`, which returns a function without arguments that
makes the run and returns a `Path`: the states at the launch and after each of so many equal parts of the duration.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from stiffdice import checks
from stiffdice.errors import InputError
from stiffdice.scene import Scene
from stiffdice.stepping import Path


class Peer(NamedTuple):
    """What imports the adapter, what its method is called, and how it is called in a figure."""

    adapter: Callable[[], Any]
    method: str
    name: str


def _scipy_ivp() -> Any:
    """Import SciPy only for who asks for it, by a name that `code_digest` can follow."""
    from stiffdice.peers import scipy_ivp

    return scipy_ivp


PEERS: dict[str, Peer] = {
    "scipy_dop853": Peer(_scipy_ivp, "dop853", "SciPy DOP853"),
    "scipy_lsoda": Peer(_scipy_ivp, "lsoda", "SciPy LSODA"),
    "scipy_radau": Peer(_scipy_ivp, "radau", "SciPy Radau"),
}


def prepare(peer: str, scene: Scene, model: str, samples: int, tolerance: float) -> Callable[[], Path]:
    """Return a function that makes a peer's run; tolerance [1]: relative, as the peer understands it.

    Raises InputError for an unknown peer and where the package it stands on is not installed.
    """
    load, method, name = PEERS[checks.choice("peer", peer, PEERS)]
    try:
        adapter = load()
    except ModuleNotFoundError as error:
        raise InputError(f"peer = {peer}: {name} needs the package {error.name}, which is not installed") from None
    run: Callable[[], Path] = adapter.prepare(scene, model, method, samples, tolerance)
    return run
