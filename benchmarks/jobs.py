"""What a shard's job costs beyond its simulation: Snakemake runs a sweep of one shard, and of more, on one core."""

from __future__ import annotations

import importlib.util
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

from benchmarks.case import Case, Effort, Missing
from benchmarks.processes import run_all

# A shard of it is one run of some thousand steps: nothing, beside its job.
STUDY = """\
question: What does a job cost?
sweeps:
  cells:
    scene: config/scenes/figure-13.yaml
    model: sliding
    contact: [gated]
    stiffness: {{from: 1.0e2, to: 1.0e3, count: {count}}}
    omega_h: {{from: 1.0, to: 0.9, count: 1}}
    members: 1
    seconds_per_job: 1.0e-9
"""
TARGET = "results/cost/sweeps/cells/sweep.h5"


@cache
def _project(count: int) -> tempfile.TemporaryDirectory[str]:
    """Return a copy of the project in the working folder, with a study of so many shards."""
    folder = tempfile.TemporaryDirectory()
    copy = Path(folder.name)
    for part in ("workflow", "config"):
        shutil.copytree(part, copy / part, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "src").symlink_to(Path("src").resolve())
    (copy / "profiles").symlink_to("workflow/profiles")
    (copy / "config" / "cost.yaml").write_text(STUDY.format(count=count), encoding="utf-8")
    _make(copy)  # once, so that everything is compiled
    return folder


def _make(copy: Path) -> None:
    words = [sys.executable, "-m", "snakemake", TARGET, "--cores", "1", "--config", "study=cost"]
    run_all([words], folder=copy)


def _ready(count: int) -> Callable[[], None]:
    copy = Path(_project(count).name)
    for made in ("results", ".snakemake"):
        shutil.rmtree(copy / made)
    return lambda: _make(copy)


def cases(effort: Effort) -> Iterator[Case | Missing]:
    """Yield a sweep of one shard and one of some more; what they differ by is the cost of the others' jobs."""
    if not Path("workflow/Snakefile").is_file() or importlib.util.find_spec("snakemake") is None:
        yield Missing("shard_jobs", "needs Snakemake, and the project's folder as the working folder")
        return
    for name, count in (("one_shard", 1), ("more_shards", 1 + effort.many)):
        yield Case(
            name,
            f"Snakemake on one core, from start to end: a sweep of {count} shard{'s' if count > 1 else ''}",
            "sweep",
            1,
            lambda count=count: _ready(count),  # type: ignore[misc]
            effort.fresh,
            "a job is a new Python that imports NumPy, numba and xarray; Snakemake itself starts once",
            fresh=True,
        )
