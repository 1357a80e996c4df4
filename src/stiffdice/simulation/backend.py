"""Who makes a run: stiffdice, or an outside engine (`peers/`), of which nothing is loaded until it is asked for.

The engines' part is found by its name at run time, which `code_digest` does not follow: what stiffdice computes itself
does not depend on it. A file of an engine's run adds `code_of` to its digest.
"""

from __future__ import annotations

import importlib
from typing import Any

from stiffdice import __version__
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene

OURS = "stiffdice"

DEFAULT_SCHEME = "symplectic_euler"  # the paper's

_DRIVING = "stiffdice.simulation.engines.driver"


def driving() -> Any:
    """Return the module that makes runs with engines."""
    return importlib.import_module(_DRIVING)


def code_of(simulator: str) -> tuple[str, ...]:
    """Return the modules that a simulator's runs stand on besides ours."""
    return () if simulator == OURS else (_DRIVING,)


def adapter_of(simulator: str) -> Any:
    """Return the adapter of an engine; raises InputError for one that is not known or not installed."""
    return driving().adapter_of(simulator)


def version_of(simulator: str) -> str:
    """Return the name and version of what makes the runs."""
    return f"{OURS} {__version__}" if simulator == OURS else str(adapter_of(simulator).versions())


def scheme_of(simulator: str, scheme: str | None) -> str:
    """Return the scheme of a run: the one asked, or symplectic_euler; of an engine, its own.

    Raises InputError for an unknown name, an engine that is not installed, and a scheme that is not an engine's own.
    """
    if simulator == OURS:
        return validation.choice("scheme", DEFAULT_SCHEME if scheme is None else scheme, schemes.SCHEMES)
    own = str(adapter_of(simulator).SCHEME)
    return own if scheme is None else validation.choice(f"simulator = {simulator}: scheme", scheme, [own])


def lag_of(simulator: str, scheme: str) -> float:
    """Return by how many steps the velocity is behind the place, as `registry.LAGS`."""
    return schemes.LAGS[scheme] if simulator == OURS else float(adapter_of(simulator).LAG)


def budget_of(simulator: str, scheme: str, steps: int) -> int:
    """Return the most work of a run, unless told otherwise: steps, or force evaluations of what takes its own steps."""
    if simulator == OURS:
        return schemes.budget_of(scheme, steps)
    return schemes.BUDGET if driving().own_steps(simulator) else steps


def check_fit(simulator: str, scheme: str, scene: Scene, model: str) -> None:
    """Raise InputError where a scheme does not apply to a scene and model, or an engine cannot represent them."""
    if simulator == OURS:
        schemes.check_fit(scheme, scene, model)
    else:
        driving().check_fit(simulator, scene, model)
