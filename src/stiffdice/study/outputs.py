"""Where the results of a study lie, and what each was asked: for the workflow, the watch, and the archive.

Asked are digests of a result's scene, its plan, its code, and of what it is made from. A job writes them into its log
as it begins; what the study asks now is compared with that. So a result that something else was asked of is seen
whatever the times of files say, and whatever Snakemake remembers. So is one that is not what the job made (`made`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from stiffdice.dynamics.code_digest import code_digest
from stiffdice.scene import scene as scenes
from stiffdice.simulation import backend
from stiffdice.simulation.engines import registry as engines
from stiffdice.study import job_log
from stiffdice.study.catalogue import DRAWINGS, EXPERIMENTS, TABLES, TIMINGS
from stiffdice.study.config import PlannedFigure, Study
from stiffdice.sweep import partition as shards
from stiffdice.sweep.grid import Sweep

Key = tuple[str, str]  # stage and name of a result

# Of every job, beside its own.
_SCRIPTS = ("job.py", "inputs.py")
_DIGITS = 16

# Of each stage the script, and the modules that it stands on besides those that the plan names.
_WRITES, _READS = "stiffdice.io.writer", "stiffdice.io.reader"
_MEASURE = ("measure.py", "stiffdice.simulation.dataset", _WRITES)
_COLLECT = ("collect.py", "stiffdice.sweep.collect", "stiffdice.sweep.partition", _READS, _WRITES)
_DRAW = ("figure.py", "stiffdice.report.figures.registry", _READS)
_CODE = {
    "trajectory": ("trajectory.py", "stiffdice.simulation.dataset", "stiffdice.simulation.energy_budget", _WRITES),
    "experiment": _MEASURE,
    "timings": _MEASURE,
    "shard": ("shard.py", "stiffdice.sweep.shard"),
    "survey": _COLLECT,
    "collect": _COLLECT,
    "frontier": ("frontier.py", "stiffdice.sweep.stability_limits", _READS, _WRITES),
    "figure": _DRAW,
    "animation": _DRAW,
    "pdf": _DRAW,
    "table": ("table.py", _READS, _WRITES),
}


class Result(NamedTuple):
    """What one job makes: files under results/STUDY/, in a stage of the workflow, under a name of its own there.

    stage: `trajectory`, `experiment`, `timings`, `shard`, `survey`, `collect`, `frontier`, `figure`, `animation`, `pdf`
    or `table`.
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
        stage, kinds = ("animation", ["gif"]) if figure.draw.endswith("animation") else ("figure", ["svg", "png"])
        files = tuple(f"figures/{name}.{kind}" for kind in kinds)
        shown = _shown_by(study, figure, DRAWINGS[figure.draw].given)
        yield Result(stage, name, files), shown
        if stage == "figure" and "pdf" in study.formats:
            yield Result("pdf", name, (f"figures/{name}.pdf",)), shown
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


class Asked(NamedTuple):
    """The first digits of digests (SHA-256).

    scene: its file's `scene_digest`; of a figure or a table, `-`. plan: what the study's file says of it, and the
    versions of engines. code: scripts and modules. inputs: all that was asked of what it is made from.
    """

    scene: str
    plan: str
    code: str
    inputs: str

    def __str__(self) -> str:
        return " ".join(f"{name} {digest}" for name, digest in self._asdict().items())


def asked(study: Study, root: Path = Path()) -> dict[Result, Asked]:
    """Return what is asked of each result; root: the project, which has the scenes, and scripts that count as code.

    A shard has no inputs: its name is a digest of what it holds or, in a later round, of what that follows from.
    """
    found: dict[Result, Asked] = {}
    for result, below in needs(study).items():
        scene, plan, *modules = _parts(study, result, root)
        inputs = list(below)
        if result.stage == "shard" and below:
            modules, inputs = ["stiffdice.sweep.partition", *modules], []
        code = _code(root, result.stage, *modules)
        found[result] = Asked(scene[:_DIGITS], _digest(plan), code, _digest([found[part] for part in inputs]))
    return found


def stale(asks: Mapping[Result, Asked], folder: Path) -> dict[Result, str]:
    """Return the results that are there though something else was asked of them or their jobs made others, and why.

    asks: what is asked now; folder: results/STUDY.
    """
    found = {}
    for result, now in asks.items():
        if any((folder / file).exists() for file in result.files):
            told = job_log.read(folder / result.log)
            reason = other(now, told)
            if told is not None and not reason:
                reason = job_log.reason_of_change(told, job_log.changed(told, folder, *result.files))
            if reason:
                found[result] = reason
    return found


def other(now: Asked, told: job_log.Told | None) -> str:
    """Return what is other in what a log says that a result was asked; empty if nothing is."""
    if told is None or not told.asked:
        return "no log says what it was made from"
    if told.asked == str(now):
        return ""
    words = told.asked.split()
    then = dict(zip(words[::2], words[1::2], strict=False))
    return f"made from other {', '.join(name for name, digest in now._asdict().items() if then.get(name) != digest)}"


def _parts(study: Study, result: Result, root: Path) -> tuple[Any, ...]:
    """Return the digest of a result's scene, its plan as plain data, and the modules that this names."""
    plan: list[Any]
    name, _, within = result.name.partition("." if result.stage == "trajectory" else "/")
    match result.stage:
        case "trajectory":
            run = study.runs[name]
            plan = [result.name, run._replace(scene="", presets=()), backend.version_of(run.simulator)]
            return scenes.load(root / run.scene, preset=within).digest, plan, *backend.code_of(run.simulator)
        case "experiment" | "timings":
            timed = result.stage == "timings"
            plans, entries = (study.timings, TIMINGS) if timed else (study.experiments, EXPERIMENTS)
            part = plans[name]
            plan = [part.measure, part.options, engines.attributes(part.options.get("methods", ()))]
            if "data" in part.options:
                plan.append(_content(root / part.options["data"]))
            return scenes.load(root / part.scene, part.changes).digest, plan, entries[part.measure].module
        case "figure" | "animation" | "pdf":
            return "-", [study.figures[name], [study.dpi]], DRAWINGS[study.figures[name].draw].module
        case "table":
            return "-", [study.tables[name], []], TABLES[study.tables[name].draw].module
    sweep = study.sweeps[name]
    if result.stage == "shard":
        plan = [within, backend.version_of(sweep.simulator)]
        return sweep.scene.digest, plan, *backend.code_of(sweep.simulator)
    # All of a frontier follows from its sweep.
    return sweep.scene.digest, None if result.stage == "frontier" else [sweep.config, dict(sweep.criteria)]


def _content(path: Path) -> str:
    """Return the digest of a file of measurements; of one that is not there, nothing."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""


def _code(root: Path, stage: str, *modules: str) -> str:
    script, *always = _CODE[stage]
    digest = hashlib.sha256(code_digest(*always, *modules).encode())
    for name in (script, *_SCRIPTS):
        digest.update((root / "workflow" / "scripts" / name).read_bytes())
    return digest.hexdigest()[:_DIGITS]


def _digest(plan: Any) -> str:
    return hashlib.sha256(json.dumps(plan, sort_keys=True).encode()).hexdigest()[:_DIGITS]
