"""Some jobs of a study fail, for real: the others go on, and what failed, why, and what was not made is told."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from tests import rounds
from tests.forks import run_module
from tests.workflow.test_workflow import Project, planned

from stiffdice.study import outputs
from stiffdice.sweep import partition as shards

GRID = {
    "scene": "config/scenes/figure-13.yaml",
    "model": "sliding",
    "contact": ["gated"],
    "omega_h": {"from": 3.0, "to": 0.5, "count": 12},
    "members": 500,
}
# Two shards: one of two thirds of the work, which is the larger file, and one of the rest.
LARGE = rounds.asked_in_parts({**GRID, "stiffness": {"from": 1e3, "to": 1e5, "count": 3}}, 1.55)
STUDY = {
    "question": "What if some of it fails?",
    "sweeps": {"large": LARGE, "small": {**GRID, "stiffness": 1e3, "members": 4}},
    "figures": {"frontier": {"draw": "frontier", "of": ["large"], "title": "Frontier"}},
}
pytestmark = [pytest.mark.workflow, pytest.mark.long]


def make(project: Project, most: int = resource.RLIM_INFINITY) -> subprocess.CompletedProcess[str]:
    """Do what `make study` does; no file may grow beyond so many bytes."""
    return subprocess.run(
        [sys.executable, "workflow/run.py", "--cores", "2", "study", "--config", "study=tiny"],
        cwd=project.folder,
        env=project.environment,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY)),
        capture_output=True,
        text=True,
        check=False,
    )


def status(project: Project, *arguments: str) -> subprocess.CompletedProcess[str]:
    words = ("status", "tiny", *arguments)
    return run_module("stiffdice.cli", *words, cwd=project.folder, environment=project.environment)


@pytest.fixture(scope="module")
def failed(tmp_path_factory):
    """A project in which one shard found no room, and one job no place for its log; and what was said."""
    project = Project(tmp_path_factory.mktemp("failed"))
    project.plan(STUDY)
    plan, sizes = planned(project).sweeps["large"], []
    for path in rounds.compute(plan, tmp_path_factory.mktemp("sizes")):
        sizes.append(path.stat().st_size)
    large, small = sizes
    assert large > 1.5 * small
    (project.folder / "results/tiny/logs/frontier/small.log/in-the-way").mkdir(parents=True)
    return project, make(project, (large + small) // 2)


def shards_of_large(project: Project) -> dict[str, shards.Shard]:
    return shards.of(planned(project).sweeps["large"])


def large_shards(project: Project) -> tuple[str, str]:
    first, second = shards_of_large(project)
    return first, second


def test_the_rest_goes_on(failed):
    project, ended = failed
    top, (_, second) = project.folder / "results/tiny", large_shards(project)
    assert ended.returncode == 1
    made = {file for result in outputs.of(planned(project)) for file in result.files if (top / file).exists()}
    assert made == {
        f"sweeps/large/shards/{second}.h5",
        *(f"sweeps/small/shards/{shard}.h5" for shard in shards.of(planned(project).sweeps["small"])),
        *("sweeps/small/sweep.h5", "sweeps/small/shards.csv"),
    }
    assert not list(top.rglob("*.part"))


def test_what_failed_is_listed_at_the_end(failed):
    project, ended = failed
    first, _ = large_shards(project)
    log = f"results/tiny/logs/shard/large/{first}.log"
    told = ended.stdout.partition("\nwhat failed in tiny\n")[2].splitlines()
    assert told[0].startswith(f"  shard large/{first}  results/tiny/sweeps/large/shards/{first}.h5: ")
    assert "File too large" in told[0]
    assert told[1:4] == [
        f"    log: {log}",
        "  not made because of that: collect large, frontier large, figure frontier",
        "  not made, and no log says why: frontier small",
    ]
    assert Path(project.folder, told[-1].removeprefix("Snakemake's own log: ")).is_file()
    # And at once, in a line that names the log.
    assert ended.stderr.count(f"stiffdice: {log}: failed: ") == 1
    assert "stiffdice: results/tiny/logs/frontier/small.log: Is a directory\n" in ended.stderr
    assert "Traceback" not in ended.stdout + ended.stderr
    assert "File too large" in (project.folder / log).read_text()


def test_status_says_so_too(failed):
    project, _ = failed
    said = status(project, "--json")
    assert (said.returncode, said.stderr) == (1, "")
    data = json.loads(said.stdout)
    assert data["results"] == {"done": 3, "stale": 0, "running": 0, "interrupted": 0, "failed": 1, "waiting": 4}
    assert data["not_made"] == ["collect large", "frontier large", "figure frontier"]
    (reason,) = (job["reason"] for job in data["jobs"] if job["state"] == "failed")
    assert "File too large" in reason
    lost, made = (sum(len(piece.steps) for piece in shard.pieces) for shard in shards_of_large(project).values())
    assert data["cells"]["large"] == {
        **{"planned": 36, "at_least": False, "done": made, "running": 0, "failed": lost, "runs": made * 500},
    }


@pytest.mark.broad
def test_once_mended_the_same_command_completes(failed):
    """The last test here: it mends what the others look at."""
    project, _ = failed
    (_, second), top = large_shards(project), project.folder / "results/tiny"
    (top / "logs/frontier/small.log/in-the-way").rmdir()
    kept = (top / f"sweeps/large/shards/{second}.h5").stat().st_mtime_ns
    ended = make(project)
    assert ended.returncode == 0, ended.stderr
    assert "what failed" not in ended.stdout
    assert (top / f"sweeps/large/shards/{second}.h5").stat().st_mtime_ns == kept
    told = status(project)
    assert (told.returncode, "results     8 of 8 done\n" in told.stdout) == (0, True)
