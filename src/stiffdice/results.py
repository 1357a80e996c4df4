"""Where the results of a study lie: one list for the workflow that makes them, the watch, and the archive."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from stiffdice import shards
from stiffdice.study import Study


class Result(NamedTuple):
    """What one job makes: files under results/STUDY/, in a stage of the workflow, under a name of its own there.

    stage: `trajectory`, `experiment`, `timings`, `shard`, `survey`, `collect`, `frontier`, `figure`, `animation` or
    `table`.
    """

    stage: str
    name: str
    files: tuple[str, ...]

    @property
    def log(self) -> str:
        """Where the job says what it does, under results/STUDY/."""
        return f"logs/{self.stage}/{self.name}.log"

    @property
    def benchmark(self) -> str:
        """Where it is kept how long the job took, under results/STUDY/."""
        return f"benchmarks/{self.stage}/{self.name}.tsv"


def of(study: Study) -> list[Result]:
    """Return the results of a study, in the order in which one stands on another."""
    return [*_made(study), *_shown(study)]


def _made(study: Study) -> Iterator[Result]:
    for name, run in study.runs.items():
        for preset in run.presets:
            yield Result("trajectory", f"{name}.{preset}", (f"runs/{name}.{preset}.h5",))
    for name in study.experiments:
        yield Result("experiment", name, (f"experiments/{name}.h5",))
    for name in study.timings:
        yield Result("timings", name, (f"benchmarks/timings/{name}.h5",))
    for name, sweep in study.sweeps.items():
        top = f"sweeps/{name}"
        plan = shards.of(sweep)
        for number in range(sweep.refine + 1):
            for shard in shards.rounds(plan, number):
                yield Result("shard", f"{name}/{shard}", (f"{top}/shards/{shard}.h5",))
            if number < sweep.refine:
                yield Result("survey", f"{name}/{number}", (f"{top}/surveys/{number}.h5",))
        yield Result("collect", name, (f"{top}/sweep.h5", f"{top}/shards.csv"))
        yield Result("frontier", name, (f"{top}/frontier.h5", f"{top}/frontier.csv"))


def _shown(study: Study) -> Iterator[Result]:
    for name, figure in study.figures.items():
        if figure.draw == "animation":
            yield Result("animation", name, (f"figures/{name}.gif",))
        else:
            yield Result("figure", name, (f"figures/{name}.svg", f"figures/{name}.png"))
    for name in study.tables:
        yield Result("table", name, (f"tables/{name}.md", f"tables/{name}.csv"))
