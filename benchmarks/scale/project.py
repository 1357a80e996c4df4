"""A copy of the project to measure in: the workflow as it is, studies of its own, results that nobody else has made."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from benchmarks.processes import environment
from benchmarks.scale import peak
from stiffdice.errors import InputError, StiffdiceError
from stiffdice.io.process import end_with_parent
from stiffdice.study import config as studies
from stiffdice.study.config import Study

_PROFILE = "workflow/profiles/default"


class Taken(NamedTuple):
    """What a command takes: wall time and processor time [s]; peak memory [B]."""

    wall: float
    cpu: float
    peak: int


class Project:
    """A copy, in a folder that may be there from before: then its results are kept, and its workflow is renewed.

    root: the project to copy, whose sources it shares, so that nothing is compiled again. Raises InputError if `root`
    is none.
    """

    def __init__(self, folder: Path, root: Path) -> None:
        self.folder = folder
        if not (root / "workflow/Snakefile").is_file():
            raise InputError(f"{root}: needs the project's folder as the working folder")
        folder.mkdir(parents=True, exist_ok=True)
        for part in ("workflow", "config"):
            shutil.rmtree(folder / part, ignore_errors=True)
            shutil.copytree(root / part, folder / part, ignore=shutil.ignore_patterns("__pycache__", "my-*"))
        (folder / "src").unlink(missing_ok=True)
        (folder / "src").symlink_to((root / "src").resolve())

    def plan(self, name: str, data: dict[str, Any]) -> Study:
        """Store a study under a name and return it, checked; raises InputError as `config.load` does."""
        path = self.folder / "config" / f"{name}.yaml"
        path.write_text(yaml.safe_dump(data, sort_keys=False, allow_unicode=True), encoding="utf-8")
        return self.study(name)

    def study(self, name: str) -> Study:
        """Return a study that was stored; its scenes are read in the working folder, as copied."""
        return studies.load(self.folder / "config" / f"{name}.yaml")

    def results(self, name: str) -> Path:
        """Return where a study's results lie."""
        return self.folder / "results" / name

    def clear(self, name: str | None = None) -> None:
        """Remove what a study has made; without a name, what all have."""
        made = [self.results(name)] if name else [self.folder / "results", self.folder / ".snakemake"]
        for folder in made:
            shutil.rmtree(folder, ignore_errors=True)

    def run(self, name: str, cores: int) -> None:
        """Make a study through `workflow/run.py`; raises StiffdiceError, naming what it said, if it fails."""
        words = [sys.executable, "workflow/run.py", "--cores", str(cores), "study", "--config", f"study={name}"]
        told = self.folder / f"{name}.log"
        with told.open("ab") as file:
            done = subprocess.run(
                words,
                cwd=self.folder,
                env=environment(),
                stdout=file,
                stderr=subprocess.STDOUT,
                check=False,
                # What runs on unwatched would be no part of any measurement.
                preexec_fn=partial(end_with_parent, "benchmarks.scale"),
            )
        if done.returncode:
            raise StiffdiceError(f"{name}: the workflow ended with status {done.returncode}; what it said: {told}")

    def dry_run(self, name: str, *arguments: str) -> tuple[int, Taken]:
        """Return how many jobs Snakemake plans for a study as things are; raises StiffdiceError if it cannot."""
        words = ["snakemake", "study", "-n", "--cores", "2", "--workflow-profile", _PROFILE, *arguments]
        said, taken = self._taken([*words, "--config", f"study={name}"])
        total = re.search(r"^total +(\d+)$", said, re.MULTILINE)
        return int(total[1]) if total else 0, taken

    def verify(self, name: str) -> Taken:
        """Have `stiffdice verify` check all results of a study; raises StiffdiceError if anything fails."""
        return self._taken(["stiffdice.cli", "verify", f"results/{name}"])[1]

    def _taken(self, words: Sequence[str]) -> tuple[str, Taken]:
        """Return what a module of Python says here, and what it takes; raises StiffdiceError if it fails."""
        asked = [sys.executable, str(peak.__file__), sys.executable, "-m", *words]
        done = subprocess.run(
            asked, cwd=self.folder, env=environment(), capture_output=True, text=True, check=False, encoding="utf-8"
        )
        said = done.stdout + done.stderr
        if done.returncode:
            raise StiffdiceError(f"{' '.join(words)}: exit status {done.returncode}: {said.strip()[-500:]}")
        wall, cpu, held = done.stdout.split()[-3:]
        return said, Taken(float(wall), float(cpu), int(held))
