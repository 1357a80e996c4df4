"""Where the results of a study lie: one list for the workflow that makes them, the watch, and the archive."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from stiffdice.study.catalogue import DRAWINGS, TABLES
from stiffdice.study.config import PlannedFigure, Study
from stiffdice.sweep import partition as shards
from stiffdice.sweep.partition import Shard


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


def dangling(result: Result, folder: Path) -> str:
    """Return which of a result's files is a link to nothing, and what to do; empty if none. folder: results/STUDY."""
    for path in (folder / file for file in result.files):
        if path.is_symlink() and not path.exists():
            return f"{path}: a link to {path.readlink()}, which is not there; bring that back, or remove the link"
    return ""


def of(study: Study) -> list[Result]:
    """Return the results of a study, in the order in which one stands on another."""
    return _every(study, _plans(study))


def _plans(study: Study) -> dict[str, Mapping[str, Shard]]:
    return {name: shards.of(sweep) for name, sweep in study.sweeps.items()}


def _every(study: Study, plans: Mapping[str, Mapping[str, Shard]]) -> list[Result]:
    return [*_made(study, plans), *_shown(study)]


def _made(study: Study, plans: Mapping[str, Mapping[str, Shard]]) -> Iterator[Result]:
    for name, run in study.runs.items():
        for preset in run.presets:
            yield Result("trajectory", f"{name}.{preset}", (f"runs/{name}.{preset}.h5",))
    for name in study.experiments:
        yield Result("experiment", name, (f"experiments/{name}.h5",))
    for name in study.timings:
        yield Result("timings", name, (f"benchmarks/timings/{name}.h5",))
    for name, sweep in study.sweeps.items():
        top = f"sweeps/{name}"
        plan = plans[name]
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


def needs(study: Study) -> dict[Result, tuple[Result, ...]]:
    """Return for each result of a study those that it is made from."""
    plans = _plans(study)
    every = _every(study, plans)
    named = {(result.stage, result.name): result for result in every}

    def collected(sweep: str, rounds: int) -> Iterator[tuple[str, str]]:
        """Yield the stages and names of what the first so many rounds are judged from."""
        for shard, plan in plans[sweep].items():
            if plan.round < rounds:
                yield "shard", f"{sweep}/{shard}"
        for number in range(rounds - 1):
            yield "survey", f"{sweep}/{number}"

    def keys(result: Result) -> Iterator[tuple[str, str]]:
        """Yield the stages and names of what a result is made from."""
        sweep, _, name = result.name.partition("/")
        match result.stage:
            case "shard":
                before = plans[sweep][name].round
                if before:
                    yield "survey", f"{sweep}/{before - 1}"
            case "survey":
                yield from collected(sweep, int(name) + 1)
            case "collect":
                yield from collected(sweep, study.sweeps[sweep].refine + 1)
            case "frontier":
                yield "collect", sweep
            case "figure" | "animation":
                planned = study.figures[result.name]
                yield from _shown_by(study, planned, DRAWINGS[planned.draw].given)
            case "table":
                planned = study.tables[result.name]
                yield from _shown_by(study, planned, TABLES[planned.draw].given)

    return {result: tuple(named[key] for key in keys(result)) for result in every}


# The stage whose results a figure or a table shows, by what it is given.
_SHOWN = {"sweeps": "frontier", "experiments": "experiment", "timings": "timings"}


def _shown_by(study: Study, planned: PlannedFigure, given: str) -> Iterator[tuple[str, str]]:
    """Yield the stages and names of what a figure or a table shows."""
    if planned.run is not None:
        for preset in study.runs[planned.run].presets:
            yield "trajectory", f"{planned.run}.{preset}"
    for name in planned.of:
        yield _SHOWN[given], name
    for name in planned.timings:
        yield "timings", name
