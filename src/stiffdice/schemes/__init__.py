"""Time-stepping schemes. A scheme is a module with TAG and `step`; one line registers it."""

from __future__ import annotations

from typing import Any

from stiffdice.compiled import choose, chosen_by_tag
from stiffdice.schemes import symplectic_euler
from stiffdice.state import Physics

_MODULES: dict[str, Any] = {
    "symplectic_euler": symplectic_euler,
}

SCHEMES = {name: module.TAG for name, module in _MODULES.items()}
_STEPS = {type(module.TAG): module.step for module in _MODULES.values()}


def step(scheme: Any, model: Any, law: Any, physics: Physics, state: Any, h: float) -> None:
    """Advance `state` by one step of h [s]; compiled code only."""
    _STEPS[type(scheme)](model, law, physics, state, h)


@chosen_by_tag(step)
def _step(scheme: Any, model: Any, law: Any, physics: Any, state: Any, h: Any) -> Any:
    chosen = choose(_STEPS, scheme)
    return lambda scheme, model, law, physics, state, h: chosen(model, law, physics, state, h)
