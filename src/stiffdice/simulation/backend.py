"""Who makes a run: stiffdice, or an outside engine (`engines/`), of which nothing is loaded until it is asked for.

The engines' part is found by its name at run time, which `code_digest` does not follow: what stiffdice computes itself
does not depend on it. A file of an engine's run adds `code_of` to its digest.
"""

from __future__ import annotations

import importlib
from typing import Any, NamedTuple

from stiffdice import __version__
from stiffdice.dynamics import model_selection
from stiffdice.errors import InputError
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene

OURS = "stiffdice"

DEFAULT_SCHEME = "symplectic_euler"  # the paper's

_DRIVER = "stiffdice.simulation.engines.registry"


class Setup(NamedTuple):
    """What is run, and by what.

    model_reason: why that model, where `auto` was asked. scheme: of the time steps, an engine's own with an engine.
    steps: to the scene's duration.
    """

    scene: Scene
    model: str
    model_reason: str
    simulator: str
    scheme: str
    steps: int

    @property
    def step_size(self) -> float:
        """Of a time step [s]."""
        return self.scene.duration / self.steps

    @property
    def ours(self) -> bool:
        """Whether the scheme is one of `schemes.SCHEMES`, no engine's."""
        return self.simulator == OURS

    @property
    def lag(self) -> float:
        """By how many steps the velocity is behind the place, as `schemes.LAGS`."""
        return schemes.LAGS[self.scheme] if self.ours else float(_adapter_of(self.simulator).LAG)

    @property
    def budget(self) -> int:
        """The most work of a run, unless told otherwise: steps, or force evaluations of what takes its own steps."""
        if self.ours:
            return schemes.budget_of(self.scheme, self.steps)
        return schemes.BUDGET if driver().ENGINES[self.simulator].own_steps else self.steps


def setup_of(scene: Scene, model: str, simulator: str, scheme: str | None, steps: int) -> Setup:
    """Return what is to be run: model `auto` resolved, scheme None filled in, the fit to the scene checked.

    Raises InputError for an unknown name, a number of steps out of range, a model that the scene, the scheme or the
    engine does not allow, and an engine that is not installed.
    """
    scheme = scheme_of(simulator, scheme)
    steps = validation.count("steps", steps)
    model, reason = model_selection.chosen(model, [scene], scene.duration / steps)
    check_fit(simulator, scheme, scene, model)
    return Setup(scene, model, reason, simulator, scheme, steps)


def driver() -> Any:
    """Return the module that makes runs with engines."""
    return importlib.import_module(_DRIVER)


def code_of(simulator: str) -> tuple[str, ...]:
    """Return the modules that a simulator's runs stand on besides ours."""
    return () if simulator == OURS else (_DRIVER,)


def _adapter_of(simulator: str) -> Any:
    validation.choice("simulator", simulator, (OURS, *driver().ENGINES))
    return driver().adapter_of(simulator)


def version_of(simulator: str) -> str:
    """Return the name and version of what makes the runs."""
    return f"{OURS} {__version__}" if simulator == OURS else str(_adapter_of(simulator).version())


def scheme_of(simulator: str, scheme: str | None) -> str:
    """Return the scheme of a run: the one asked, or symplectic_euler; of an engine, its own.

    Raises InputError for an unknown name, an engine that is not installed, and a scheme that is not an engine's own.
    """
    if simulator == OURS:
        return validation.choice("scheme", DEFAULT_SCHEME if scheme is None else scheme, schemes.SCHEMES)
    own = str(_adapter_of(simulator).SCHEME)
    return own if scheme is None else validation.choice(f"simulator = {simulator}: scheme", scheme, [own])


def check_fit(simulator: str, scheme: str, scene: Scene, model: str) -> None:
    """Raise InputError where a scheme does not apply to a scene and model, or an engine cannot represent them."""
    if simulator == OURS:
        schemes.check_fit(scheme, scene, model)
        return
    if not scene.cube.distribution.is_isotropic:
        raise InputError(
            f"simulator = {simulator}: takes a cube with the same moment of inertia about every axis through its "
            f"centre; allowed for another box is {OURS}"
        )
    driver().check_fit(simulator, scene, model)
