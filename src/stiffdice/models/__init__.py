"""Which motion is computed. A model is a module with TAG, `force`, `kick` and `drift`; one line registers it."""

from __future__ import annotations

from typing import Any

from stiffdice.compiled import choose, chosen_by_tag
from stiffdice.contact import Wrench
from stiffdice.models import sliding, tumbling
from stiffdice.state import Physics

_MODULES: dict[str, Any] = {
    "sliding": sliding,
    "tumbling": tumbling,
}

MODELS = {name: module.TAG for name, module in _MODULES.items()}
_FORCES = {type(module.TAG): module.force for module in _MODULES.values()}
_KICKS = {type(module.TAG): module.kick for module in _MODULES.values()}
_DRIFTS = {type(module.TAG): module.drift for module in _MODULES.values()}


def force(model: Any, law: Any, physics: Physics, state: Any) -> Wrench:
    """Return force [N] and torque [N m] on the body in this state; compiled code only."""
    return _FORCES[type(model)](law, physics, state)


@chosen_by_tag(force)
def _force(model: Any, law: Any, physics: Any, state: Any) -> Any:
    chosen = choose(_FORCES, model)
    return lambda model, law, physics, state: chosen(law, physics, state)


def kick(model: Any, physics: Physics, state: Any, wrench: Wrench, h: float) -> None:
    """Advance the momenta by h [s] under a force and torque; compiled code only."""
    _KICKS[type(model)](physics, state, wrench, h)


@chosen_by_tag(kick)
def _kick(model: Any, physics: Any, state: Any, wrench: Any, h: Any) -> Any:
    chosen = choose(_KICKS, model)
    return lambda model, physics, state, wrench, h: chosen(physics, state, wrench, h)


def drift(model: Any, physics: Physics, state: Any, h: float) -> None:
    """Advance place and orientation by h [s] at the state's velocities; compiled code only."""
    _DRIFTS[type(model)](physics, state, h)


@chosen_by_tag(drift)
def _drift(model: Any, physics: Any, state: Any, h: Any) -> Any:
    chosen = choose(_DRIFTS, model)
    return lambda model, physics, state, h: chosen(physics, state, h)
