"""Time-stepping schemes. A scheme is a module with TAG, LAG, FORMULA and `step`; one line registers it.

One that takes steps of its own has a `part` in place of `step` (`adaptive_steps.py`). One that has a `swing`, for which
the bounds of `fast_forward.py` are proven, takes many steps of a contact at once.
One that does not apply to every scene and model also has
`unfit(scene, model)`, which says why not.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from stiffdice.dynamics.compilation import by_tag, constant, njit
from stiffdice.errors import InputError
from stiffdice.integrators import (
    adaptive_steps,
    forward_euler,
    free_flight,
    implicit_euler,
    rk4,
    symplectic_euler,
    velocity_verlet,
)
from stiffdice.integrators.event_driven import scheme as event
from stiffdice.integrators.exact import scheme as exact
from stiffdice.scene.scene import Scene

_MODULES: dict[str, Any] = {
    "symplectic_euler": symplectic_euler,
    "forward_euler": forward_euler,
    "velocity_verlet": velocity_verlet,
    "rk4": rk4,
    "implicit_euler": implicit_euler,
    "exact": exact,
    "event": event,
}

SCHEMES = {name: module.TAG for name, module in _MODULES.items()}
FORMULAS: dict[str, str] = {name: module.FORMULA for name, module in _MODULES.items()}


def _chosen(of: Callable[[Any], Any]) -> Callable[..., Any]:
    """Return the function `of` a scheme's module, chosen by the scheme's tag."""
    return by_tag({type(module.TAG): of(module) for module in _MODULES.values()})


def _step_of(module: Any) -> Any:
    return adaptive_steps.whole(module.part) if hasattr(module, "part") else module.step


# (scheme, model, law, physics, state, h, tolerance) -> force evaluations, or pieces in closed form: advance `state` by
# one step of h [s]. Only a scheme that controls its own error looks at the tolerance [1] of it.
step = _chosen(_step_of)


def _whole(module: Any) -> Any:
    """Return what takes a step of a scheme that takes it whole."""
    step = module.step

    @njit
    def one(model: Any, law: Any, physics: Any, state: Any, sight: Any, tolerance: Any) -> tuple[int, int]:
        return 1, step(model, law, physics, state, sight.step_size, tolerance)

    return one


# (scheme, model, law, physics, state, sight, tolerance) -> steps done, 0 or 1, and force evaluations: advance
# `state` by one step, or by a part of it (`adaptive_steps.py`).
one = by_tag(
    {
        type(module.TAG): adaptive_steps.resumed(module.part) if hasattr(module, "part") else _whole(module)
        for module in _MODULES.values()
    }
)

# (scheme, model, physics, state, h, steps): take so many steps of free flight at once, as stepping would to round-off.
flight = _chosen(lambda module: free_flight.lagging(module.LAG))

# (scheme, place, speed, h, steps, square, rate, constant) -> the change of place and the new speed after so many steps
# at once of a point whose acceleration is constant − square·place − rate·speed, as stepping would to round-off; both
# not-a-number where that is not known.
swing = _chosen(lambda module: getattr(module, "swing", constant((math.nan, math.nan))))

# (scheme) -> whether the bounds of `fast_forward.py`, for how long a phase lasts and what stays at rest, hold for it.
proven = _chosen(lambda module: constant(hasattr(module, "swing")))

# What a scheme that controls its own error aims at, relative to the motion, unless told otherwise.
TOLERANCE = 1e-9
FINEST, COARSEST = 1e-13, 0.1

# Schemes that take steps of their own between two states: what happens in one of ours, they do not tell.
OWN_STEPS = frozenset(name for name, module in _MODULES.items() if getattr(module, "OWN_STEPS", False))

# Schemes of which a step may take any amount of work.
IN_PARTS = frozenset(name for name, module in _MODULES.items() if hasattr(module, "part"))


# The most force evaluations of a run whose number of steps does not bound them, unless told otherwise.
BUDGET = adaptive_steps.BUDGET


def budget_of(scheme: str, steps: int) -> int:
    """Return the most work of a run, unless told otherwise: all its steps, or BUDGET."""
    return BUDGET if scheme in IN_PARTS else steps


# By how many steps a scheme's velocity is behind its place: in free flight the path's slope is u + LAG·(u − u_before).
LAGS: dict[str, float] = {name: module.LAG for name, module in _MODULES.items()}


def unfit(scheme: str, scene: Scene, model: str) -> str | None:
    """Return in one sentence why a scheme does not apply to a scene and model, or None if it does."""
    module = _MODULES[scheme]
    why: str | None = module.unfit(scene, model) if hasattr(module, "unfit") else None
    return why


def check_fit(scheme: str, scene: Scene, model: str) -> None:
    """Raise InputError where a scheme does not apply to a scene and model."""
    why = unfit(scheme, scene, model)
    if why is not None:
        raise InputError(why)
