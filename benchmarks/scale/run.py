"""Measure what is asked, one thing after the other, and store it as a page and as a table for programs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.scale import report
from benchmarks.scale.extension import extend
from benchmarks.scale.growth import grow
from benchmarks.scale.project import Project
from benchmarks.scale.record import Record
from benchmarks.scale.studies import of_size, runs_of
from benchmarks.scale.workers import compare
from stiffdice.dynamics.code_digest import code_digest
from stiffdice.errors import InputError
from stiffdice.experiments.timing import machine
from stiffdice.io import yaml_loader
from stiffdice.io.writer import write_bytes
from stiffdice.scene import validation

# In the folder: what was measured so far.
RECORD = "record.json"


class Asked(NamedTuple):
    """What to measure.

    study: a file in config/, of which sizes are made by fewer stiffnesses. sizes: numbers of runs. cores: of each.
    workers: number of runs with which two are put against one, `rounds` times each; 0: not at all. extend: number of
    runs of the grid that is extended; 0: not at all.
    """

    study: Path
    sizes: Sequence[int]
    cores: int
    workers: int
    rounds: int
    extend: int


def measure(asked: Asked, folder: Path, tell: Callable[[str], None] = lambda text: None) -> str:
    """Measure what was not yet, store all of it in a folder as `scale.md` and `scale.csv`, and return the page.

    The working folder is the project's. tell: is told what is done next. Raises InputError for a study that cannot be
    made smaller, StiffdiceError if the workflow fails, OutputError where nothing can be written.
    """
    data = _read(asked)
    project = Project(folder / "project", Path())
    record = Record(folder / RECORD, _key(data, asked.cores))
    own = runs_of(project.plan("whole", data))
    if "machine" not in record:
        before = machine()  # the load is that from before
        project.clear()
        tell("all that is compiled is compiled first")
        project.plan("warm", of_size(data, 0))
        project.run("warm", asked.cores)
        record["machine"] = before
    grown = []
    for runs in asked.sizes:
        tell(f"{runs:,} runs; how far: stiffdice status runs-{runs}, in {project.folder}")
        grown.append(grow(project, record, of_size(data, runs / own), f"runs-{runs}", asked.cores))
    workers = extension = None
    if asked.workers:
        workers = compare(project, record, of_size(data, asked.workers / own), asked.rounds, tell)
    if asked.extend:
        tell(f"a grid of {asked.extend:,} runs, extended, and in one go")
        extension = extend(project, record, of_size(data, asked.extend / own), asked.cores)
    found = report.page(grown, workers, extension, record["machine"])
    write_bytes(found.markdown.encode(), folder / "scale.md")
    write_bytes(found.csv.encode(), folder / "scale.csv")
    return found.markdown


def _read(asked: Asked) -> dict[str, Any]:
    """Return the study as plain data; raises InputError, with a line for the first thing that is wrong."""
    for key, value in [*(("runs", size) for size in asked.sizes), ("cores", asked.cores), ("rounds", asked.rounds)]:
        validation.count(key, value)
    if not asked.study.is_file():
        raise InputError(f"{asked.study}: no such file")
    data = yaml_loader.load(asked.study)
    if not isinstance(data, dict) or not data.get("sweeps"):
        raise InputError(f"{asked.study}: has no sweeps to measure")
    return data


def _key(data: dict[str, Any], cores: int) -> str:
    """Return a digest of all that the numbers depend on, but the machine."""
    digest = hashlib.sha256(json.dumps([data, cores], sort_keys=True).encode())
    digest.update(
        code_digest("stiffdice.study.config", "stiffdice.sweep.shard", "stiffdice.sweep.stability_limits").encode()
    )
    rules = (Path("workflow/Snakefile"), *Path("workflow").rglob("*.smk"))
    for path in sorted([*rules, *Path("workflow/scripts").glob("*.py")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()
