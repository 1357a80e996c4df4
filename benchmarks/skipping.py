"""A column of a gated sweep on stiff ground: watched step by step, and with what is known taken at once.

Both are the loop of `simulate`, with the same criteria; what differs is its `leap`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence

from benchmarks.case import Case, Effort
from benchmarks.scenes import scene_of
from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import Ensemble
from stiffdice.scene.scene import Scene
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.run import simulate

STIFFNESS = 1e8  # [kg/s²]

# Of the cells: contact frequency times step size.
OMEGA_H = (1.0, 0.3, 0.1)


def cases(effort: Effort) -> Iterator[Case]:
    """Yield a column of a sweep for each model, with skipping and without."""
    full = effort.steps >= 100_000
    scene = dataclasses.replace(scene_of("gated", 1).with_ground(stiffness=STIFFNESS), duration=10.0 if full else 1.5)
    steps = [round(linear_theory.steps_for(scene, omega_h)) for omega_h in (OMEGA_H if full else OMEGA_H[:1])]
    told = f"sweep's column, gated, S = 10⁸ kg/s², {len(steps)} × {effort.members} runs of {scene.duration:g} s"
    for model in ("vertical", "tumbling"):
        cells = [phased(scene, model, n, effort.members, turned(scene, model, effort.members)) for n in steps]
        yield Case(
            f"sweep_{model}",
            f"{told}, {model}: what is known is taken at once",
            "step",
            sum(steps) * effort.members,
            _column(scene, model, steps, cells, leap=None),
            effort.slow,
            "contacts are stepped, and flights cost what it takes to find their end",
        )
        yield Case(
            f"sweep_{model}_stepped",
            f"{told}, {model}: watched step by step",
            "step",
            sum(steps) * effort.members,
            _column(scene, model, steps, cells, leap=False),
            min(effort.slow, 3),
            "the kernel in the listings' order, and the criteria that look at every step",
        )


def _column(
    scene: Scene, model: str, steps: Sequence[int], cells: Sequence[Ensemble], *, leap: bool | None
) -> Callable[[], Callable[[], None]]:
    def run() -> None:
        for count, members in zip(steps, cells, strict=True):
            simulate(scene, model=model, steps=count, members=members, leap=leap)

    return lambda: run
