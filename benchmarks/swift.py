"""Plain stepping by the fast kernel, one run at a time."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.case import Case, Effort
from benchmarks.scenes import scene_of
from stiffdice.integrators import swift

# Which wait for each other where a node is felt: from the speed to the push, by its friction and torque to the spin,
# and by the rotation to the next half edge.
_FELT = ["multiply"] * 15 + ["add"] * 22 + ["divide", "root"]

# By model and law: operations of a step, those that wait for each other, and what holds it back. Gated: in the air;
# there the velocity waits for one sum, a turned half edge for a product and two sums. Ungated: while the cube falls.
COUNTS = {
    ("tumbling", "gated"): (
        78,
        ["multiply", "add", "add"],
        "turning half edges in the air; on the ground waiting",
    ),
    ("tumbling", "ungated"): (908, _FELT, "waiting: each operation on eight nodes at once needs the one before"),
    ("vertical", "gated"): (3, ["add"], "the sum that each step's velocity waits for, and a bounce nobody foresees"),
    ("vertical", "ungated"): (
        102,
        ["multiply"] * 2 + ["add"] * 7,
        "the push waits for the velocity, and it for the push",
    ),
}


def cases(effort: Effort) -> Iterator[Case]:
    """Yield the throw and its vertical part under both laws."""
    for (model, law), (flops, chain, holds) in COUNTS.items():
        run = swift.prepare(scene_of(law, effort.steps), model, effort.steps)
        yield Case(
            f"swift_{model}_{law}",
            f"{'throw' if model == 'tumbling' else model}, {law}: fast kernel",
            "step",
            effort.steps,
            lambda run=run: run,  # type: ignore[misc]
            effort.rounds,
            holds,
            flops,
            chain,
        )
