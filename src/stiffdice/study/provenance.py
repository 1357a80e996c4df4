"""What each result of a study was asked: digests of its scene, its plan, its code, and of what it is made from.

A job writes them into its log as it begins; what the study asks now is compared with that. So a result that something
else was asked of is seen whatever the times of files say, and whatever Snakemake remembers. So is one that is not what
the job made (`made`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from stiffdice.dynamics.code_digest import code_digest
from stiffdice.scene import scene as scenes
from stiffdice.simulation import backend
from stiffdice.simulation.engines import registry as engines
from stiffdice.study import catalogue, job_log, output_digest, outputs
from stiffdice.study.config import Study
from stiffdice.study.outputs import Result

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
    "table": ("table.py", _READS, _WRITES),
}


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


def of(study: Study, root: Path = Path()) -> dict[Result, Asked]:
    """Return what is asked of each result; root: the project, which has the scenes, and scripts that count as code.

    A shard has no inputs: its name is a digest of what it holds or, in a later round, of what that follows from.
    """
    found: dict[Result, Asked] = {}
    for result, below in outputs.needs(study).items():
        scene, plan, *modules = _parts(study, result, root)
        inputs = list(below)
        if result.stage == "shard" and below:
            modules, inputs = ["stiffdice.sweep.partition", *modules], []
        code = _code(root, result.stage, *modules)
        found[result] = Asked(scene[:_DIGITS], _digest(plan), code, _digest([found[part] for part in inputs]))
    return found


def stale(asked: Mapping[Result, Asked], folder: Path) -> dict[Result, str]:
    """Return the results that are there though something else was asked of them or their jobs made others, and why.

    asked: what is asked now; folder: results/STUDY.
    """
    found = {}
    for result, now in asked.items():
        if any((folder / file).exists() for file in result.files):
            told = job_log.read(folder / result.log)
            reason = other(now, told)
            if told is not None and not reason:
                reason = output_digest.reason(told, output_digest.changed(told, folder, *result.files))
            if reason:
                found[result] = reason
    return found


def other(asked: Asked, told: job_log.Told | None) -> str:
    """Return what is other in what a log says that a result was asked; empty if nothing is."""
    if told is None or not told.asked:
        return "no log says what it was made from"
    if told.asked == str(asked):
        return ""
    words = told.asked.split()
    then = dict(zip(words[::2], words[1::2], strict=False))
    return f"made from other {', '.join(name for name, now in asked._asdict().items() if then.get(name) != now)}"


def _parts(study: Study, result: Result, root: Path) -> tuple[Any, ...]:
    """Return the digest of a result's scene, its plan as plain data, and the modules that this names."""
    plan: list[Any]
    name, _, part = result.name.partition("." if result.stage == "trajectory" else "/")
    match result.stage:
        case "trajectory":
            run = study.runs[name]
            plan = [result.name, run._replace(scene="", presets=()), backend.version_of(run.simulator)]
            return scenes.load(root / run.scene, preset=part).digest, plan, *backend.code_of(run.simulator)
        case "experiment" | "timings":
            timed = result.stage == "timings"
            plans, entries = (study.timings, catalogue.TIMINGS) if timed else (study.experiments, catalogue.EXPERIMENTS)
            asked = plans[name]
            plan = [asked.measure, asked.options, engines.attributes(asked.options.get("methods", ()))]
            return scenes.load(root / asked.scene, asked.changes).digest, plan, entries[asked.measure].module
        case "figure" | "animation":
            return "-", [study.figures[name], [study.dpi]], catalogue.DRAWINGS[study.figures[name].draw].module
        case "table":
            return "-", [study.tables[name], []], catalogue.TABLES[study.tables[name].draw].module
    sweep = study.sweeps[name]
    if result.stage == "shard":
        plan = [part, backend.version_of(sweep.simulator)]
        return sweep.scene.digest, plan, *backend.code_of(sweep.simulator)
    # All of a frontier follows from its sweep.
    return sweep.scene.digest, None if result.stage == "frontier" else [sweep.config, dict(sweep.criteria)]


def _code(root: Path, stage: str, *modules: str) -> str:
    script, *always = _CODE[stage]
    digest = hashlib.sha256(code_digest(*always, *modules).encode())
    for name in (script, *_SCRIPTS):
        digest.update((root / "workflow" / "scripts" / name).read_bytes())
    return digest.hexdigest()[:_DIGITS]


def _digest(plan: Any) -> str:
    return hashlib.sha256(json.dumps(plan, sort_keys=True).encode()).hexdigest()[:_DIGITS]
