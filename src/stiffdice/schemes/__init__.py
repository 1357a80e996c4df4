"""Time-stepping schemes. A scheme is a module with TAG, LAG, `step`, `flight` and `swing`; one line registers it."""

from __future__ import annotations

from typing import Any

from stiffdice.compiled import by_tag
from stiffdice.schemes import event, symplectic_euler

_MODULES: dict[str, Any] = {
    "symplectic_euler": symplectic_euler,
    "event": event,
}

SCHEMES = {name: module.TAG for name, module in _MODULES.items()}

# (scheme, model, law, physics, state, h, tolerance) -> force evaluations: advance `state` by one step of h [s]. Only a
# scheme that controls its own error looks at the tolerance [1] of it.
step = by_tag({type(module.TAG): module.step for module in _MODULES.values()})

# (scheme, model, physics, state, h, steps): take so many steps of free flight at once, as stepping would to round-off.
flight = by_tag({type(module.TAG): module.flight for module in _MODULES.values()})

# (scheme, place, speed, h, steps, square, rate, constant) -> the change of place and the new speed after so many steps
# at once of a point whose acceleration is constant − square·place − rate·speed, as stepping would to round-off.
swing = by_tag({type(module.TAG): module.swing for module in _MODULES.values()})

# What a scheme that controls its own error aims at, relative to the motion, unless told otherwise.
TOLERANCE = 1e-9
FINEST, COARSEST = 1e-13, 0.1

# Schemes that take steps of their own between two states: what happens in one of ours, they do not tell.
OWN_STEPS = frozenset(name for name, module in _MODULES.items() if getattr(module, "OWN_STEPS", False))

# By how many steps a scheme's velocity is behind its place: in free flight the path's slope is u + LAG·(u − u_before).
LAGS: dict[str, float] = {name: module.LAG for name, module in _MODULES.items()}
