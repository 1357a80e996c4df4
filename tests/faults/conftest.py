"""A small study with every stage, run once undisturbed; tests take copies of the project that it ran in."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from tests import rounds

ROOT = Path(__file__).parent.parent.parent
SMALL = {
    "question": "Is anything lost?",
    "runs": {"stiff": {"scene": "config/scenes/figure-09.yaml", "model": "sliding", "steps": 10000, "every": 100}},
    "sweeps": {
        "steps": rounds.asked_in_parts(
            {
                "scene": "config/scenes/figure-13.yaml",
                "model": "sliding",
                "contact": ["ungated", "gated"],
                "stiffness": {"from": 1e3, "to": 1e4, "count": 2},
                "omega_h": {"from": 3.0, "to": 0.5, "count": 4},
                "members": 2,
            },
            4,
        ),
    },
    "experiments": {
        "books": {
            "measure": "energy-budget",
            "scene": "config/scenes/figure-09.yaml",
            "options": {"steps": [10000, 20000]},
        }
    },
    "figures": {"books": {"draw": "energy-budget", "of": ["books"], "title": "Books"}},
    "tables": {"answers": {"tell": "paper-questions", "of": ["steps"], "title": "Answers"}},
}


class Project:
    """A copy of the project, with a study of its own."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.results = folder / "results" / "small"

    @classmethod
    def new(cls, folder: Path) -> Project:
        for name in ("workflow", "config"):
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        (folder / "src").symlink_to(ROOT / "src")  # another place would be compiled again
        (folder / "profiles").symlink_to("workflow/profiles")
        (folder / "results").mkdir()
        (folder / "config" / "small.yaml").write_text(yaml.safe_dump(SMALL))
        return cls(folder)

    def copy(self, folder: Path, *, results: bool = True) -> Project:
        """Copy it with its results and what Snakemake knows of them, or as it was before anything was made."""
        left_out = () if results else ("results", ".snakemake")
        shutil.copytree(self.folder, folder, symlinks=True, ignore=lambda _, names: {*left_out} & {*names})
        (folder / "results").mkdir(exist_ok=True)
        return Project(folder)

    def command(self, by: str = "run.py", *arguments: str) -> list[str]:
        tool = {"run.py": ["workflow/run.py"], "snakemake": ["-m", "snakemake"]}[by]
        return [sys.executable, *tool, "--cores", "2", "study", *arguments, "--config", "study=small"]

    def run(self, by: str = "run.py", *arguments: str, **changes: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self.command(by, *arguments),
            cwd=self.folder,
            env=self.environment | changes,
            capture_output=True,
            text=True,
            check=False,
        )

    @property
    def environment(self) -> dict[str, str]:
        places = [str((self.folder / "src").resolve()), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
        return {**os.environ, "PYTHONPATH": os.pathsep.join(places)}

    def data(self) -> dict[str, bytes]:
        """Return all files of the study by name, hidden ones included, but what differs between two rebuilds."""
        files = (path for path in self.results.rglob("*") if path.is_file())
        named = {path.relative_to(self.results).as_posix(): path for path in files}
        return {
            name: path.read_bytes() for name, path in named.items() if not name.startswith(("logs/", "benchmarks/"))
        }


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory) -> Project:
    """The project whose study ran undisturbed; of all workers the first makes it. Not to be changed."""
    top = tmp_path_factory.getbasetemp()
    top = top.parent if "PYTEST_XDIST_WORKER" in os.environ else top
    with (top / "undisturbed.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        told = top / "undisturbed.json"
        if not told.exists():
            project = Project.new(top / "undisturbed")
            begun = time.monotonic()
            done = project.run()
            assert done.returncode == 0, done.stdout + done.stderr
            told.write_text(json.dumps({"seconds": time.monotonic() - begun}))
    project = Project(top / "undisturbed")
    project.seconds = json.loads(told.read_text())["seconds"]
    return project
