"""Time-stepping schemes. A scheme is a module with TAG, LAG, FORMULA and `step`; one line registers it.

FORMULA: one step, as files tell it. LAG: by how many steps the velocity is behind the place; in free flight the path's
slope is u + LAG·(u − u_before).

A scheme that takes steps of its own, of which one of ours may need any number, has a `part` in place of `step`: it
advances a state by an interval, or by less after some work. A run goes on from there, so that it can be stopped, and
ended by a budget, within an interval. Work is counted, not timed: a run is the same on every machine. One that has a
`swing`, for which the bounds of `fast_forward.py` are proven, takes many steps of a contact at once. One that does not
apply to every scene and model also has `unfit(scene, model)`, which says why not. OF_PAIRS: true of one that uses the
model only by its `force`, `kick`, `drift` and `change`, so that two boxes can be run by it, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from stiffdice.dynamics.compilation import by_tag, constant, njit
from stiffdice.dynamics.state import Physics, States
from stiffdice.errors import InputError
from stiffdice.integrators import forward_euler, free_flight, implicit_euler, rk4, symplectic_euler, velocity_verlet
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
LAGS: dict[str, float] = {name: module.LAG for name, module in _MODULES.items()}

# Schemes that take steps of their own between two states: what happens in one of ours, they do not tell.
OWN_STEPS = frozenset(name for name, module in _MODULES.items() if getattr(module, "OWN_STEPS", False))

# Schemes that two boxes can be run by.
OF_PAIRS = tuple(name for name, module in _MODULES.items() if getattr(module, "OF_PAIRS", False))

# What a scheme that controls its own error aims at, relative to the motion, unless told otherwise.
TOLERANCE = 1e-9
FINEST, COARSEST = 1e-13, 0.1

# Force evaluations, or pieces in closed form, after which a part ends: some hundredths of a second; and the most of a
# run unless told otherwise: a few seconds.
PART, BUDGET = 20_000, 10_000_000


def _chosen(of: Callable[[Any], Any]) -> Callable[..., Any]:
    """Return the function `of` a scheme's module, chosen by the scheme's tag."""
    return by_tag({type(module.TAG): of(module) for module in _MODULES.values()})


def _step_of(module: Any) -> Any:
    if not hasattr(module, "part"):
        return module.step
    part = module.part

    @njit
    def step(model: Any, physics: Any, state: Any, h: float, tolerance: float) -> int:
        left, evaluations = h, 0
        while left > 0.0:
            left, count, _ = part(model, physics, state, left, tolerance, PART)
            evaluations += count
        return evaluations

    return step


def _one_of(module: Any) -> Any:
    if hasattr(module, "part"):
        part = module.part

        @njit
        def one(model: Any, physics: Any, state: Any, sight: Any, tolerance: float) -> tuple[int, int]:
            h = sight.pending if sight.pending > 0.0 else sight.step_size
            sight.pending, evaluations, work = part(model, physics, state, h, tolerance, PART)
            sight.work += work
            return 0 if sight.pending > 0.0 else 1, evaluations
    else:
        step = module.step

        @njit
        def one(model: Any, physics: Any, state: Any, sight: Any, tolerance: float) -> tuple[int, int]:
            return 1, step(model, physics, state, sight.step_size, tolerance)

    return one


# (scheme, model, physics, state, h, tolerance) -> force evaluations, or pieces in closed form: advance `state` by
# one step of h [s]. Only a scheme that controls its own error looks at the tolerance [1] of it.
step = _chosen(_step_of)

# (scheme, model, physics, state, sight, tolerance) -> steps done, 0 or 1, and force evaluations: advance `state`
# by one step, or by a part of it; `sight.pending` is what is left of it then [s], and `sight.work` what was done.
one = _chosen(_one_of)

_lag = _chosen(lambda module: constant(module.LAG))


@njit
def flight(scheme: Any, model: Any, physics: Any, state: Any, h: float, steps: int) -> None:
    """Take so many steps of free flight at once, as stepping would to round-off."""
    free_flight.flight(model, physics, state, h, steps, _lag(scheme))


# (scheme, place, speed, h, steps, square, rate, constant) -> the change of place and the new speed after so many steps
# at once of a point whose acceleration is constant − square·place − rate·speed, as stepping would to round-off; both
# not-a-number where that is not known.
swing = _chosen(lambda module: getattr(module, "swing", constant((math.nan, math.nan))))

# (scheme) -> whether the bounds of `fast_forward.py`, for how long a phase lasts and what stays at rest, hold for it.
proven = _chosen(lambda module: constant(hasattr(module, "swing")))


@njit(cache=True)
def advance(scheme: Any, model: Any, physics: Physics, samples: States, every: int, h: float, tolerance: float) -> int:
    """Step from samples[0] on and keep every K-th state in the others; return how often the force was evaluated."""
    evaluations = 0
    for k in range(1, samples.shape[0]):
        samples[k] = samples[k - 1]
        state = samples[k]
        for _ in range(every):
            evaluations += step(scheme, model, physics, state, h, tolerance)
    return evaluations


def budget_of(scheme: str, steps: int) -> int:
    """Return the most work of a run, unless told otherwise: all its steps, or BUDGET."""
    return BUDGET if hasattr(_MODULES[scheme], "part") else steps


def unfit(scheme: str, scene: Scene, model: str) -> str | None:
    """Return in one sentence why a scheme does not apply to a scene and model, or None if it does."""
    why: str | None = getattr(_MODULES[scheme], "unfit", lambda *_: None)(scene, model)
    return why


def check_fit(scheme: str, scene: Scene, model: str) -> None:
    """Raise InputError where a scheme does not apply to a scene and model."""
    if why := unfit(scheme, scene, model):
        raise InputError(why)
