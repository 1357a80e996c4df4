"""The workflow as a module of somebody else's: in their folder, by their names, from where it is kept."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from tests.forks import run_module

ROOT = Path(__file__).parents[2]
SWEEP = {
    "scene": "scenes/edges.yaml",
    "model": "sliding",
    "contact": ["gated"],
    "stiffness": {"from": 1e3, "to": 1e4, "count": 2},
    "omega_h": {"from": 3.0, "to": 0.3, "count": 8},
    "members": 2,
    "refine": 1,
}
TIMED = {
    "measure": "work-precision",
    "scene": "scenes/mine.yaml",
    "options": {"stiffness": [100], "per_decade": 1, "methods": ["symplectic_euler"], "affordable": 0.01, "rounds": 1},
}
STUDY = {
    "question": "Does it work elsewhere?",
    "runs": {"one": {"scene": "scenes/mine.yaml", "model": "sliding", "steps": 1000, "presets": ["as_written"]}},
    "figures": {"position": {"draw": "position", "run": "one", "title": "Position"}},
}
LARGE = {**STUDY, "sweeps": {"edges": SWEEP}, "timings": {"work": TIMED}}
MODULE = """
module dice:
    snakefile: {snakefile!r}
    config: config
"""
ALL = """
rule all:
    input:
        "lines.txt",
        "die/results/mine/figures/position.svg",
        "die/results/mine/benchmarks/timings/work.h5",
"""
LINES = """
rule lines:
    input: "die/results/mine/sweeps/edges/frontier.csv"
    output: "lines.txt"
    shell: "wc -l < {input} > {output}"
"""
pytestmark = [pytest.mark.workflow, pytest.mark.long]


class User:
    """A folder with a scene and a study `mine`, and a Snakefile that is somebody's own."""

    def __init__(self, folder: Path, snakefile: str, study: dict) -> None:
        self.folder = folder
        (folder / "scenes").mkdir()
        (folder / "config").mkdir()
        for name, original in (("mine", "figure-09"), ("edges", "figure-13")):
            shutil.copy(ROOT / f"config/scenes/{original}.yaml", folder / f"scenes/{name}.yaml")
        self.plan(study)
        (folder / "config/config.yml").write_text("study: mine\n")
        (folder / "Snakefile").write_text(f'configfile: "config/config.yml"\n{snakefile}')

    def plan(self, study: dict) -> None:
        (self.folder / "config/mine.yaml").write_text(yaml.safe_dump(study))

    @property
    def environment(self) -> dict[str, str]:
        places = [str(ROOT / "src"), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
        return {**os.environ, "PYTHONPATH": os.pathsep.join(places)}

    def snakemake(self, *words: str, **environment: str) -> str:
        """Run Snakemake, and return what it said."""
        done = subprocess.run(
            [sys.executable, "-m", "snakemake", "--cores", "2", *words],
            cwd=self.folder,
            env=self.environment | environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout + done.stderr

    def dry_run(self, *words: str, **environment: str) -> str:
        """Return what Snakemake would do."""
        done = run_module("snakemake", "-n", *words, cwd=self.folder, environment=self.environment | environment)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout + done.stderr

    def files(self, top: str) -> set[str]:
        return {str(path.relative_to(self.folder / top)) for path in (self.folder / top).rglob("*") if path.is_file()}


def test_it_makes_the_study_of_the_users_folder_there(tmp_path):
    before = {path: path.stat().st_mtime_ns for path in (ROOT / "workflow").rglob("*") if path.suffix != ".pyc"}
    user = User(tmp_path, MODULE.format(snakefile=f"{ROOT}/workflow/Snakefile") + "use rule * from dice\n", STUDY)
    user.snakemake()
    assert {"runs/one.as_written.h5", "figures/position.svg"} <= user.files("results/mine")
    assert "Nothing to be done" in user.dry_run()
    told = run_module("stiffdice.cli", "status", "mine", cwd=tmp_path, environment=user.environment)
    assert (told.returncode, "2 of 2 done" in told.stdout) == (0, True), told
    changed = {path for path, time in before.items() if not path.is_dir() and path.stat().st_mtime_ns != time}
    assert not changed


def test_rules_and_results_may_have_a_prefix_beside_the_users_own(tmp_path):
    """The default target is the user's; every rule runs; what is asked otherwise is seen under the prefix, too."""
    module = MODULE.format(snakefile=f"{ROOT}/workflow/Snakefile") + '    prefix: "die"\n\n'
    user = User(tmp_path, f"{ALL}{module}use rule * from dice as die_*\n{LINES}", LARGE)
    user.snakemake()
    assert (tmp_path / "lines.txt").read_text().strip() == "5"
    assert not (tmp_path / "results").exists()
    log = (tmp_path / "die/results/mine/logs/frontier/edges.log").read_text()
    assert "made: sweeps/edges/frontier.h5 " in log
    assert "Nothing to be done" in user.dry_run("die_study")
    shutil.rmtree(tmp_path / ".snakemake")  # what Snakemake remembers; the logs say what was asked
    (tmp_path / "scenes/mine.yaml").write_text((tmp_path / "scenes/mine.yaml").read_text() + "gravity: 9.7\n")
    due = user.dry_run("die_study", "--rerun-triggers", "mtime")
    rules = {*re.findall(r"^die_(\w+) +1$", due, re.MULTILINE)}
    assert rules == {"figure", "study", "timing", "trajectory"}


@pytest.mark.broad
def test_it_is_deployed_from_a_repository_as_the_catalogue_does(tmp_path):
    """As snakedeploy does it, with the module named by its place on GitHub; a folder stands for that here."""
    repository = tmp_path / "repository"
    shutil.copytree(ROOT / "workflow", repository / "workflow", ignore=shutil.ignore_patterns("__pycache__"))
    git = ["git", "-C", str(repository), "-c", "user.name=me", "-c", "user.email=me@example.org"]
    for words in (["init", "-q"], ["add", "-A"], ["commit", "-q", "-m", "all"], ["tag", "v1"]):
        subprocess.run([*git, *words], check=True)
    folder = tmp_path / "user"
    folder.mkdir()
    user = User(folder, "", STUDY)
    (folder / "workflow").mkdir()
    module = MODULE.replace("{snakefile!r}", 'github("owner/dice", path="workflow/Snakefile", tag="v1")')
    (folder / "Snakefile").rename(folder / "workflow/Snakefile")
    with (folder / "workflow/Snakefile").open("a") as file:
        file.write(f"{module}\nuse rule * from dice\n")
    elsewhere = {"GIT_CONFIG_COUNT": "1", "GIT_CONFIG_KEY_0": f"url.file://{repository}.insteadOf"}
    elsewhere |= {"GIT_CONFIG_VALUE_0": "https://github.com/owner/dice", "XDG_CACHE_HOME": str(tmp_path / "cache")}
    user.snakemake(**elsewhere)
    assert {"runs/one.as_written.h5", "figures/position.svg"} <= user.files("results/mine")
    assert "Nothing to be done" in user.dry_run(**elsewhere)


def test_a_study_that_is_not_there_is_said_in_one_line(tmp_path):
    user = User(tmp_path, MODULE.format(snakefile=f"{ROOT}/workflow/Snakefile") + "use rule * from dice\n", STUDY)
    (tmp_path / "config/config.yml").write_text("study: main\n")
    done = run_module("snakemake", "-n", cwd=tmp_path, environment=user.environment)
    assert done.returncode == 2
    assert "stiffdice: config/main.yaml: there is no study main; those in config/ are mine" in done.stderr
