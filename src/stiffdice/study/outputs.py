"""Where the results of a study lie: one list for the workflow that makes them, the watch, and the archive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from stiffdice.study.catalogue import DRAWINGS, TABLES
from stiffdice.study.config import PlannedFigure, Study
from stiffdice.sweep import partition as shards
from stiffdice.sweep.grid import Sweep

Key = tuple[str, str]  # stage and name of a result


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
    return list(needs(study))


def needs(study: Study) -> dict[Result, tuple[Result, ...]]:
    """Return for each result of a study those that it is made from, in the same order."""
    found, below = dict[Key, Result](), dict[Result, tuple[Result, ...]]()
    for result, keys in _made(study):
        found[result.stage, result.name] = result
        below[result] = tuple(found[key] for key in keys)
    return below


def _made(study: Study) -> Iterator[tuple[Result, Sequence[Key]]]:
    """Yield each result with the keys of those that it is made from."""
    for name, run in study.runs.items():
        for preset in run.presets:
            yield Result("trajectory", f"{name}.{preset}", (f"runs/{name}.{preset}.h5",)), ()
    for name in study.experiments:
        yield Result("experiment", name, (f"experiments/{name}.h5",)), ()
    for name in study.timings:
        yield Result("timings", name, (f"benchmarks/timings/{name}.h5",)), ()
    for name, sweep in study.sweeps.items():
        yield from _swept(f"sweeps/{name}", name, sweep)
    for name, figure in study.figures.items():
        stage, kinds = ("animation", ["gif"]) if figure.draw == "animation" else ("figure", ["svg", "png"])
        files = tuple(f"figures/{name}.{kind}" for kind in kinds)
        yield Result(stage, name, files), _shown_by(study, figure, DRAWINGS[figure.draw].given)
    for name, table in study.tables.items():
        files = f"tables/{name}.md", f"tables/{name}.csv"
        yield Result("table", name, files), _shown_by(study, table, TABLES[table.draw].given)


def _swept(top: str, name: str, sweep: Sweep) -> Iterator[tuple[Result, Sequence[Key]]]:
    plan, collected, surveys = shards.of(sweep), list[Key](), list[Key]()
    for number in range(sweep.refine + 1):
        for shard in shards.rounds(plan, number):
            yield Result("shard", f"{name}/{shard}", (f"{top}/shards/{shard}.h5",)), surveys[-1:]
            collected.append(("shard", f"{name}/{shard}"))
        if number < sweep.refine:
            yield Result("survey", f"{name}/{number}", (f"{top}/surveys/{number}.h5",)), [*collected, *surveys]
            surveys.append(("survey", f"{name}/{number}"))
    yield Result("collect", name, (f"{top}/sweep.h5", f"{top}/shards.csv")), [*collected, *surveys]
    yield Result("frontier", name, (f"{top}/frontier.h5", f"{top}/frontier.csv")), [("collect", name)]


# The stage whose results a figure or a table shows, by what it is given.
_SHOWN = {"sweeps": "frontier", "experiments": "experiment", "timings": "timings"}


def _shown_by(study: Study, planned: PlannedFigure, given: str) -> list[Key]:
    if given == "runs":
        return [("trajectory", f"{name}.{preset}") for name in planned.of for preset in study.runs[name].presets]
    return [(_SHOWN[given], name) for name in planned.of] + [("timings", name) for name in planned.timings]
