"""One Slurm for all tests here, and one run of a small study on this machine alone, to compare with."""

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
from tests.slurm.cluster import Cluster, run, until

ROOT = Path(__file__).parent.parent.parent
# Only where tests/slurm/run made room for it: `make test-slurm`.
collect_ignore_glob = [] if "STIFFDICE_SLURM" in os.environ else ["test_*.py"]

# Four jobs of some seconds or so.
SWEEP = rounds.asked_in_parts(
    {
        "scene": "config/scenes/figure-13.yaml",
        "model": "sliding",
        "contact": ["ungated", "gated"],
        "stiffness": {"from": 1e3, "to": 1e4, "count": 2},
        "omega_h": {"from": 3.0, "to": 0.5, "count": 24},
        "members": 3000,
        "early_stop": False,
    },
    4,
)
STUDY = {"question": "Is anything lost?", "sweeps": {"steps": SWEEP}}
A_MOMENT = 0.5  # seconds in which a file that has its name is laid out, too; a shard takes some
# Looks at the queue come fast, so that tests do not wait for them; all else is the profile's.
EVERY_SECOND = Path(__file__).parent / "every_second.py"
FAST = {"max-status-checks-per-second": 1, "latency-wait": 5}


class Project:
    """A copy of the project, with a study of its own."""

    def __init__(self, folder: Path, study: dict = STUDY):
        self.folder = folder
        for name in ("workflow", "config"):
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        (folder / "src").symlink_to(ROOT / "src")  # another place would be compiled again
        (folder / "results").mkdir()
        (folder / "config" / "small.yaml").write_text(yaml.safe_dump(study))
        self.results = folder / "results" / "small"

    def start(self, profile: str = "slurm", *arguments: str) -> Run:
        fast = [f"--{name}={value}" for name, value in FAST.items()] if profile == "slurm" else ["--cores=2"]
        command = ["--workflow-profile", f"workflow/profiles/{profile}", "study", *fast, *arguments]
        return Run(self, [sys.executable, str(EVERY_SECOND), *command, "--config", "study=small"])

    def data(self) -> dict[str, bytes]:
        """Return all files of the study by name, hidden ones included, but what differs between two rebuilds."""
        files = (path for path in self.results.rglob("*") if path.is_file())
        named = {path.relative_to(self.results).as_posix(): path for path in files}
        return {
            name: path.read_bytes() for name, path in named.items() if not name.startswith(("logs/", "benchmarks/"))
        }

    def shards_at_work(self) -> list[Path]:
        """Wait until shards are being written, and return their unfinished files."""

        def begun() -> list[Path]:
            return sorted(self.results.glob("sweeps/steps/shards/.*.part"))

        until("a shard is at work", begun, 120)
        found = begun()
        time.sleep(A_MOMENT)
        return found


class Run:
    """Snakemake at work on a project."""

    def __init__(self, project: Project, command: list[str]):
        self._said = project.folder / "said.txt"
        places = [str(ROOT / "src"), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
        with self._said.open("w") as said:
            self.process = subprocess.Popen(
                command,
                cwd=project.folder,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(places)},
                stdout=said,
                stderr=subprocess.STDOUT,
            )

    def said(self) -> str:
        return self._said.read_text()

    def end(self, seconds: float = 300) -> str:
        """Wait until it ends well, and return what it said."""
        try:
            status = self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            status = None
        said = self.said()
        assert status == 0, f"exit status {status}\n{said}\n{run('squeue', '--all', '--long')}"
        return said


@pytest.fixture(scope="session")
def cluster(tmp_path_factory):
    """A Slurm with accounting."""
    cluster = Cluster(tmp_path_factory.mktemp("slurm"))
    begun = time.monotonic()
    try:
        cluster.start()
        print(f"\nSlurm is up after {time.monotonic() - begun:.0f} s in {cluster.top}")
        yield cluster
    finally:
        cluster.stop()


@pytest.fixture(scope="session")
def local(tmp_path_factory) -> dict[str, bytes]:
    """The data of the study, made on this machine alone."""
    project = Project(tmp_path_factory.mktemp("local") / "project")
    project.start("default").end()
    return project.data()
