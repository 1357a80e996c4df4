"""Two runs of the workflow at once in one clone: of two studies, or of one."""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
import yaml
from tests.forks import run_module
from tests.workflow.test_workflow import ROOT, Project

BOOKS = {"measure": "energy-budget", "scene": "config/scenes/figure-09.yaml", "options": {"steps": [10000, 20000]}}
pytestmark = pytest.mark.workflow


def run(name: str, *more: str) -> list[str]:
    return [sys.executable, "workflow/run.py", "--cores", "2", "study", *more, "--config", f"study={name}"]


@pytest.fixture
def project(tmp_path):
    """A project with two studies, of three jobs and of two."""
    project = Project(tmp_path)
    for name, experiments in (("many", ("first", "second", "third")), ("few", ("books", "more"))):
        study = {"question": "Which?", "experiments": dict.fromkeys(experiments, BOOKS)}
        (tmp_path / f"config/{name}.yaml").write_text(yaml.safe_dump(study))
    return project


def start(project: Project, command: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command,
        cwd=project.folder,
        env=project.environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def call(project: Project, command: list[str]) -> tuple[int, str, str]:
    started = start(project, command)
    out, err = started.communicate()
    return started.returncode, out, err


@pytest.mark.long
def test_two_studies_at_once_each_tell_of_their_own_jobs(project):
    (project.folder / "results/few/logs/experiment/books.log/in-the-way").mkdir(parents=True)
    started = {name: start(project, run(name)) for name in ("many", "few")}
    told = {name: process.communicate()[0] for name, process in started.items()}
    assert started["many"].returncode == 0
    assert re.search(r"^all +3 ", told["many"], re.MULTILINE)
    shares = re.search(r"^\d+ s on 2 cores: (\d+)% of them simulation, (\d+)% start-up", told["many"], re.MULTILINE)
    assert sum(map(int, shares.groups())) <= 100
    assert started["few"].returncode == 1
    assert "what failed in many" not in told["few"]
    (log,) = re.findall(r"^Snakemake's own log: (.*)$", told["few"], re.MULTILINE)
    assert "results/few/" in (project.folder / log).read_text()


@pytest.fixture
def suspended(project):
    """A run of a study whose Snakemake stands still amid it."""
    first = start(project, run("many"))
    (snakemake,) = wait_for(
        lambda: [child for child in psutil.Process(first.pid).children() if "snakemake" in child.cmdline()]
    )
    wait_for(lambda: list((project.folder / "results").glob("many/logs/**/*.log")))
    snakemake.suspend()
    yield first
    with contextlib.suppress(ProcessLookupError):
        os.killpg(first.pid, signal.SIGKILL)
    first.communicate()


@pytest.mark.long
def test_a_study_that_is_being_made_is_not_made_twice_and_nothing_stays_locked(project, suspended):
    first = suspended
    holder = rf"by process {first.pid} on \S+ since \d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d UTC"
    line = rf"stiffdice: many is being made already: {holder}"

    status, out, err = call(project, run("many"))
    assert (status, out) == (2, "")
    assert re.fullmatch(rf"{line}\n", err)
    # Snakemake by itself says it among its own words, and looks on as before.
    itself = {"cwd": project.folder, "environment": project.environment}
    done = run_module("snakemake", "results/many/experiments/second.h5", **itself)
    assert done.returncode == 2
    assert re.search(rf"^{line}$", done.stderr, re.MULTILINE)
    assert run_module("snakemake", "-n", "study", "--config", "study=many", **itself).returncode == 0
    status, _, err = call(project, [sys.executable, "workflow/clean.py"])
    assert status == 2
    assert re.fullmatch(rf"{line}; nothing was removed\n", err)
    assert (project.folder / "results/many/logs").is_dir()

    first.send_signal(signal.SIGKILL)
    first.wait()
    status, out, _ = call(project, run("many"))
    assert status == 0, out
    assert call(project, [sys.executable, "workflow/clean.py"]) == (0, "", "")
    assert list((project.folder / "results").iterdir()) == []
    assert not (project.folder / ".snakemake").exists()


@pytest.mark.long
def test_a_killed_make_takes_its_run_along(project):
    shutil.copy(ROOT / "Makefile", project.folder)
    make = start(project, ["make", "-o", "install", "study", "STUDY=many", f"BIN={Path(sys.executable).parent}"])
    wait_for(lambda: list((project.folder / "results").glob("many/logs/**/*.log")))
    everything = psutil.Process(make.pid).children(recursive=True)
    assert len(everything) >= 2  # the run and Snakemake, which by themselves stay as they are
    for process in everything[:2]:
        process.suspend()
    make.kill()
    _, alive = psutil.wait_procs(everything, timeout=20)
    for process in alive:
        process.kill()
    assert alive == []
    make.communicate()


@pytest.mark.long
def test_a_run_goes_on_without_the_shell_that_started_it(project):
    command = f"{shlex.join(run('few'))} > told 2>&1 & while [ ! -d results/few/logs ]; do sleep 0.1; done"
    subprocess.run(["sh", "-c", command], cwd=project.folder, env=project.environment, check=True)
    wait_for(lambda: has_all(project, "books", "more"))


def has_all(project: Project, *experiments: str) -> bool:
    return all((project.folder / f"results/few/experiments/{name}.h5").exists() for name in experiments)


def wait_for(found):
    """Return what is found as soon as there is something."""
    deadline = time.monotonic() + 60
    while not (there := found()):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return there


@pytest.mark.parametrize(
    ("words", "studies"),
    [
        (["paper"], ["paper"]),
        ([], ["paper"]),
        (["study", "--forcerun", "collect", "--config", "study=quick"], ["quick"]),
        (["study", "--config=study=quick"], ["quick"]),
        (["study", "--config", "study=no-such"], []),
        (["stability", "extremes"], ["extremes", "stability"]),
        (["results/quick/runs/figure-04.as_listed.h5"], ["quick"]),
    ],
)
def test_the_studies_asked_for_are_known_from_the_command(monkeypatch, words, studies):
    monkeypatch.syspath_prepend(ROOT / "workflow")
    import run as workflow_run

    assert workflow_run.asked_for(words) == studies
