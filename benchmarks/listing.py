"""Plain stepping in the listings' order: the kernel that every scheme shares, and that agrees with them bit by bit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from benchmarks.case import Case, Effort
from benchmarks.scenes import scene_of
from stiffdice.simulation.engines import registry as engines

SCHEME = "symplectic_euler"


class Count(NamedTuple):
    """Of a step, from the source: operations, those that wait for each other, and what else holds it back.

    With the gated law, of a step in the air: the chain is a bound from below, as steps on the ground take more.
    """

    flops: int
    chain: Sequence[str]
    holds: str


def _chain(**counts: int) -> list[str]:
    return [name for name, count in counts.items() for _ in range(count)]


# By model and law. Ungated, a force follows from the speed, in the air, too, and is summed node after node.
COUNTS = {
    ("tumbling", "gated"): Count(
        195,
        _chain(multiply=1, add=2),
        "work, not waiting: every step finds sine, cosine, a root and nine quotients, and turns eight nodes in memory",
    ),
    ("tumbling", "ungated"): Count(
        755,
        _chain(multiply=11, add=26, divide=3, root=2, sine=1),
        "eight nodes a step, one after the other, each with a root and three quotients that keep the divider busy",
    ),
    ("vertical", "gated"): Count(
        6,
        _chain(add=1),
        "the state lives in memory: a step waits until what the step before stored can be loaded",
    ),
    ("vertical", "ungated"): Count(
        53,
        _chain(multiply=2, add=11, divide=1),
        "eight equal pushes are added one after the other, in the listings' order; then a quotient",
    ),
}


def cases(effort: Effort) -> Iterator[Case]:
    """Yield the throw and its vertical part under both laws."""
    for (model, law), count in COUNTS.items():
        scene = scene_of(law, effort.steps)
        run = engines.ready(SCHEME, scene, model, effort.steps, 1)
        yield Case(
            f"listing_{model}_{law}",
            f"{'throw' if model == 'tumbling' else model}, {law}: kernel in the listings' order",
            "step",
            effort.steps,
            run,
            effort.rounds,
            count.holds,
            count.flops,
            count.chain,
        )
