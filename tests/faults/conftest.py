"""A small study with every stage, run once undisturbed; tests take copies of the project that it ran in."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from tests import rounds
from tests.shared import made_once

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
    "figures": {"position": {"draw": "position", "run": "stiff", "title": "Position"}},
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

    def command(self, by: str = "run.py", *arguments: str, target: str = "study") -> list[str]:
        tool = {"run.py": ["workflow/run.py"], "snakemake": ["-m", "snakemake"]}[by]
        return [sys.executable, *tool, "--cores", "2", target, *arguments, "--config", "study=small"]

    def run(
        self, by: str = "run.py", *arguments: str, target: str = "study", **changes: str
    ) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self.command(by, *arguments, target=target),
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

    def make(folder: Path) -> dict[str, float]:
        begun = time.monotonic()
        done = Project.new(folder).run()
        assert done.returncode == 0, done.stdout + done.stderr
        return {"seconds": time.monotonic() - begun}

    folder, said = made_once(tmp_path_factory, "undisturbed", make)
    project = Project(folder)
    project.seconds = said["seconds"]
    return project
