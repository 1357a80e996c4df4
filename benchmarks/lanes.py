"""The ensemble kernel: many members side by side in the lanes of vector registers, on one thread and on two."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.case import Case, Effort
from benchmarks.scenes import scene_of
from stiffdice.integrators import batched_kernel
from stiffdice.simulation.initial_conditions import phased, turned

# By model: members at full effort, and what holds it back.
MEMBERS = {
    "vertical": (2048, "comparisons and selections, which use the same units and are not counted"),
    "tumbling": (256, "roots and quotients of eight nodes, for which a vector unit takes many cycles"),
}


def cases(effort: Effort) -> Iterator[Case]:
    """Yield the throw and its vertical part under both laws, on one thread and on two."""
    steps = max(1, effort.steps // 5)
    for (model, law), flops in batched_kernel.FLOPS.items():
        if model not in MEMBERS:
            continue
        (most, holds), scene = MEMBERS[model], scene_of(law, steps)
        count = min(most, 64 * effort.members**2)
        launches = phased(scene, model, steps, count, turned(scene, model, count)).launches
        for threads in (1, 2):
            run = batched_kernel.prepare(scene, model, launches, steps, threads=threads)
            yield Case(
                f"lanes_{model}_{law}" + ("" if threads == 1 else "_2_threads"),
                f"ensemble of {count}, {model}, {law}: {threads} thread{'s' if threads > 1 else ''}",
                "step",
                count * steps,
                lambda run=run: run,  # type: ignore[misc]
                effort.rounds,
                holds if threads == 1 else "as on one thread, and what two cores share",
                flops,
            )
