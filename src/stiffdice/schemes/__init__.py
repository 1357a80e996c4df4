"""Time-stepping schemes. A scheme is a module with TAG and `step`; one line registers it."""

from __future__ import annotations

from typing import Any

from stiffdice.compiled import by_tag
from stiffdice.schemes import symplectic_euler

_MODULES: dict[str, Any] = {
    "symplectic_euler": symplectic_euler,
}

SCHEMES = {name: module.TAG for name, module in _MODULES.items()}

# (scheme, model, law, physics, state, h): advance `state` by one step of h [s].
step = by_tag({type(module.TAG): module.step for module in _MODULES.values()})
