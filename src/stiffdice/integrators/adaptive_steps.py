"""What bounds the work of schemes that take steps of their own, of which one interval may need any number.

Such a scheme has a `part`: it advances a state by an interval, or by less after some work. A run goes on from there, so
that it can be stopped, and ended by a budget, within an interval. Work is counted, not timed: a run is the same on
every machine.
"""

from __future__ import annotations

from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.state import Physics

# Force evaluations, or pieces in closed form, after which a part ends: some hundredths of a second.
PART = 20_000

# The most work of a run unless told otherwise: a few seconds.
BUDGET = 10_000_000


def whole(part: Any) -> Any:
    """Return a function that takes a scheme's step whole, for compiled code: as many parts as it takes."""

    @njit
    def step(model: Any, law: Any, physics: Physics, state: Any, h: float, tolerance: float) -> int:
        left, evaluations = h, 0
        while left > 0.0:
            left, count, _ = part(model, law, physics, state, left, tolerance, PART)
            evaluations += count
        return evaluations

    return step


def resumed(part: Any) -> Any:
    """Return a function that takes a scheme's step part by part, for compiled code.

    (model, law, physics, state, sight, tolerance) -> steps done, 0 or 1, and force evaluations. It advances
    `state` by one part; `sight.pending` is what is left of the step then [s], and `sight.work` grows by what was done.
    """

    @njit
    def one(model: Any, law: Any, physics: Physics, state: Any, sight: Any, tolerance: float) -> tuple[int, int]:
        h = sight.pending if sight.pending > 0.0 else sight.step_size
        left, evaluations, work = part(model, law, physics, state, h, tolerance, PART)
        sight.pending = left
        sight.work += work
        return 0 if left > 0.0 else 1, evaluations

    return one
