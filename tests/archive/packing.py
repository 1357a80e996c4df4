"""A finished study in a project of its own, made by the library as the workflow would make it."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import yaml
from tests import rounds

from stiffdice.io.reader import open_file, parts
from stiffdice.io.writer import write_bytes, write_dataset
from stiffdice.report.figures import registry as figures
from stiffdice.scene import scene as scenes
from stiffdice.simulation.dataset import run_dataset
from stiffdice.simulation.run import simulate
from stiffdice.study import config as study
from stiffdice.study import job_log, outputs
from stiffdice.study.catalogue import TABLES
from stiffdice.study.job_log import digest_of
from stiffdice.sweep import partition, stability_limits
from stiffdice.sweep.collect import collect
from stiffdice.sweep.shard import compute_shard

ROOT = Path(__file__).parent.parent.parent
SWEEP = {
    "scene": "config/scenes/figure-13.yaml",
    "model": "sliding",
    "contact": ["ungated"],
    "stiffness": {"from": 1e3, "to": 1e4, "count": 3},
    "omega_h": {"from": 3.0, "to": 0.5, "count": 5},
    "members": 4,
}
TINY = {
    "question": "Is <all> of it packed?",
    "runs": {
        "fall": {
            "scene": "config/scenes/figure-09.yaml",
            "presets": ["as_listed"],
            "model": "sliding",
            "steps": 10000,
            "every": 500,
        }
    },
    "sweeps": {
        "steps": {**rounds.asked_in_parts(SWEEP, 2), "scene": "my-scene.yaml"},
    },
    "figures": {"position": {"draw": "position", "run": "fall", "title": "Position & place"}},
    "tables": {"answers": {"tell": "paper-questions", "of": ["steps"], "title": "Answers"}},
}
AN_HOUR = 1_800_000_000  # seconds since 1970: 2027-01-15 08:00:00 UTC


def project(folder: Path) -> Path:
    """Return a copy of the project without results, with the study `tiny` in it."""
    for name in ("workflow", "config", "docs", "requirements"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "*.png"))
    # A few sources stand for all, so that tests do not digest and deflate them again and again.
    (folder / "src/stiffdice/io").mkdir(parents=True)
    for name in ("__init__.py", "errors.py", "io/reader.py"):
        shutil.copy(ROOT / "src/stiffdice" / name, folder / "src/stiffdice" / name)
    for path in ROOT.iterdir():
        if path.is_file() and not path.name.startswith("."):
            shutil.copy(path, folder)
    (folder / "profiles").symlink_to("workflow/profiles")
    (folder / "results").mkdir()
    shutil.copy(ROOT / "results/README.md", folder / "results")
    shutil.copy(ROOT / "config/scenes/figure-13.yaml", folder / "my-scene.yaml")
    (folder / "config/tiny.yaml").write_text(yaml.safe_dump(TINY))
    return folder


def plan(folder: Path) -> study.Study:
    """Return the study `tiny` of a project; its scenes are read in the current folder."""
    return study.load(folder / "config/tiny.yaml")


def make(planned: study.Study, folder: Path, ended: float = AN_HOUR) -> None:
    """Make all results of the study in a project, with logs and benchmarks of jobs that ended then [s since 1970]."""
    top, asks = folder / "results/tiny", outputs.asked(planned, folder)
    for result in outputs.of(planned):
        for name in (*result.files, result.log, result.benchmark):
            (top / name).parent.mkdir(parents=True, exist_ok=True)
        (top / result.benchmark).write_text(f"s\th:m:s\n12.5\t{ended}\n")
        os.utime(top / result.benchmark, (ended, ended))
        first = top / result.files[0]
        if result.stage == "trajectory":
            run = planned.runs["fall"]
            given = scenes.load(folder / run.scene, preset="as_listed")
            write_dataset(run_dataset(simulate(given, model=run.model, steps=run.steps, every=run.every)), first)
        elif result.stage == "shard":
            grid = planned.sweeps["steps"]
            compute_shard(grid, partition.of(grid)[first.stem].pieces, first)
        elif result.stage == "collect":
            runs = (part for path in sorted(top.rglob("shards/*.h5")) for part in parts(path))
            write_dataset(collect(runs, planned.sweeps["steps"].criteria), first)
            write_bytes(b"shard,cells\n", top / result.files[1])
        elif result.stage == "frontier":
            found = stability_limits.find(open_file(top / "sweeps/steps/sweep.h5"))
            write_dataset(found, first)
            write_bytes(stability_limits.table(found).encode(), top / result.files[1])
        elif result.stage == "figure":
            data = {"as_listed": open_file(top / "runs/fall.as_listed.h5")}
            figures.draw("position", data, "Position", 60, [str(top / file) for file in result.files])
        else:
            told = TABLES["paper-questions"].load()({"steps": open_file(top / "sweeps/steps/frontier.h5")}, "Answers")
            write_bytes(told.markdown.encode(), first)
            write_bytes(told.csv.encode(), top / result.files[1])
        digests = [job_log.made(name, digest_of(top / name)) for name in result.files]
        (top / result.log).write_text("\n".join([job_log.asked(asks[result]), *digests, f"done at {ended}\n"]))
    (top / "report.html").write_text(f"<p>made at {ended}</p>")
