"""The whole pipeline on a tiny study, as a user runs it, in a copy of the project."""

from __future__ import annotations

import csv
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from PIL import Image
from tests import rounds
from tests.forks import run_module

from stiffdice.io.reader import open_file, parts
from stiffdice.io.structure_check import FORMAT_VERSION
from stiffdice.scene.scene import load
from stiffdice.simulation.run import simulate
from stiffdice.study import config as studies
from stiffdice.sweep import partition
from stiffdice.sweep.collect import collect
from stiffdice.sweep.shard import compute_shard

ROOT = Path(__file__).parent.parent.parent
WORK = {"measure": "work-precision", "scene": "config/scenes/figure-01.yaml", "set": ["duration=3"]}
FEW = {"stiffness": [100], "per_decade": 1, "methods": ["symplectic_euler", "scipy_lsoda"]}
TITLE = "Books </script><script>alert(1)</script>"
# One of each kind: a survey needs a refined sweep, an animation a cube that turns.
TINY = {
    "question": "Does all of it work?",
    "runs": {
        "stiff": {"scene": "config/scenes/figure-09.yaml", "model": "sliding", "steps": 10000, "every": 10},
        "turn": {
            "scene": "config/scenes/figure-01.yaml",
            "presets": ["as_listed"],
            "model": "tumbling",
            "steps": 20000,
            "every": 2000,
        },
    },
    "sweeps": {
        "steps": {
            "scene": "config/scenes/figure-13.yaml",
            "model": "sliding",
            "contact": ["ungated", "gated"],
            "stiffness": {"from": 1e3, "to": 1e5, "count": 3},
            "omega_h": {"from": 3.0, "to": 0.3, "count": 12},
            "members": 4,
            "early_stop": False,
            "refine": 1,
        },
    },
    "experiments": {
        "books": {
            "measure": "energy-budget",
            "scene": "config/scenes/figure-09.yaml",
            "options": {"steps": [10000, 20000]},
        },
        "work": {**WORK, "options": {**FEW, "steps": 1e5}},
    },
    "timings": {"work": {**WORK, "options": {**FEW, "affordable": 0.01, "rounds": 1}}},
    "figures": {
        "position": {"draw": "position", "run": "stiff", "title": "Position"},
        "frontier": {"draw": "frontier", "of": ["steps"], "title": "Frontier"},
        "movie": {"draw": "animation", "run": "turn", "title": "Movie"},
        "books": {"draw": "energy-budget", "of": ["books"], "title": TITLE},
        "times": {"draw": "work-precision", "of": ["work"], "timings": ["work"], "title": "Times"},
    },
    "tables": {"answers": {"tell": "paper-questions", "of": ["steps"], "title": "Answers"}},
}
# What two rebuilds share, whatever their shards are: all but times, and the figures that show them.
DATA = ("runs/*.h5", "sweeps/steps/sweep.h5", "sweeps/steps/frontier.*", "experiments/*", "tables/*", "figures/[!t]*")
# What is due when all runs of the sweep are.
AGAIN = {"shard": 3, "survey": 1, "collect": 1, "frontier": 1, "figure": 1, "table": 1}
pytestmark = pytest.mark.workflow


class Project:
    """A copy of the project whose files a test may change."""

    def __init__(self, folder: Path):
        self.folder = folder
        for name in ("workflow", "config"):
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        (folder / "src").symlink_to(ROOT / "src")
        (folder / "profiles").symlink_to("workflow/profiles")
        (folder / "results").mkdir()
        self.plan(TINY)

    @classmethod
    def at(cls, folder: Path) -> Project:
        """Return the project that is in a folder already."""
        project = cls.__new__(cls)
        project.folder = folder
        return project

    def plan(self, study: dict) -> None:
        (self.folder / "config" / "tiny.yaml").write_text(yaml.safe_dump(study))

    def command(self, *arguments: str) -> list[str]:
        return [sys.executable, "-m", "snakemake", "study", *arguments, "--config", "study=tiny"]

    @property
    def environment(self) -> dict[str, str]:
        # A proxy that is not there: whatever asks the network fails.
        away = {"http_proxy": "http://127.0.0.1:9", "https_proxy": "http://127.0.0.1:9"}
        places = [str((self.folder / "src").resolve()), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
        return {**os.environ, **away, "PYTHONPATH": os.pathsep.join(places)}

    def snakemake(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self.command(*arguments),
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
        )

    def without_jobs(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Do the same where Snakemake has no job to start."""
        asked = ("study", *arguments, "--config", "study=tiny")
        return run_module("snakemake", *asked, cwd=self.folder, environment=self.environment)

    def make(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Do what `make study` does."""
        command = [sys.executable, "workflow/run.py", "study", *arguments, "--config", "study=tiny"]
        return subprocess.run(
            command, cwd=self.folder, env=self.environment, capture_output=True, text=True, check=False
        )

    def jobs_due(self) -> dict[str, int]:
        """Return what a dry run would do: rules and how many jobs of each."""
        done = self.without_jobs("-n")
        assert done.returncode == 0, done.stderr
        listed = re.search(r"^job +count\n-+ +-+\n(.*?)^total", done.stdout + done.stderr, re.MULTILINE | re.DOTALL)
        rows = [line.split() for line in listed[1].splitlines()] if listed else []
        return {rule: int(count) for rule, count in rows if rule != "study"}

    def results(self, *patterns: str) -> dict[str, bytes]:
        top = self.folder / "results" / "tiny"
        return {
            str(path.relative_to(top)): path.read_bytes() for pattern in patterns for path in sorted(top.glob(pattern))
        }


@pytest.fixture(scope="module")
def finished(made, tmp_path_factory):
    """A project whose study has run, with sources of its own; tests that change it take their changes back."""
    project = made.copy(tmp_path_factory.mktemp("finished") / "project")
    (project.folder / "src").unlink()
    shutil.copytree(ROOT / "src", project.folder / "src", ignore=shutil.ignore_patterns("__pycache__"))
    return project


@pytest.fixture
def edited(finished):
    """Change a file of the finished project for one test."""
    kept: dict[Path, tuple[bytes, os.stat_result]] = {}

    def edit(name: str, change) -> None:
        path = finished.folder / name
        kept.setdefault(path, (path.read_bytes(), path.stat()))
        path.write_text(change(path.read_text()))

    yield edit
    for path, (content, stat) in kept.items():
        path.write_bytes(content)
        os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def planned(project: Project) -> studies.Study:
    return studies.load(project.folder / "config/tiny.yaml")


def test_all_files_are_there_and_open(finished):
    top = finished.folder / "results" / "tiny"
    for name in ("position", "frontier"):
        with Image.open(top / "figures" / f"{name}.png") as image:
            image.load()
            assert min(image.size) > 300
        assert "<svg" in (top / "figures" / f"{name}.svg").read_text()
    hdf5 = sorted(top.rglob("*.h5"))
    assert len(hdf5) == 3 + 3 + 1 + 2 + 2 + 1  # runs, shards, survey, sweep and frontier, experiments, timing
    for path in hdf5:
        with xr.open_dataset(path) as found:
            assert found.attrs["format_version"] == FORMAT_VERSION
    assert {path.stem for path in (top / "benchmarks").rglob("*.tsv")} >= {"steps", "answers", "stiff.as_listed"}


@pytest.mark.parametrize("preset", ["as_listed", "as_written"])
def test_a_stored_run_is_what_the_simulator_says(finished, preset):
    found = open_file(finished.folder / f"results/tiny/runs/stiff.{preset}.h5")
    run = simulate(load(ROOT / "config/scenes/figure-09.yaml", preset=preset), model="sliding", steps=10_000, every=10)
    np.testing.assert_array_equal(found.position, run.trajectory.state["position"])
    assert found.attrs["model"] == "sliding"
    energy = {"as_listed": 96.10474204235116, "as_written": 222.30}
    assert float(found.energy_paper.max()) == pytest.approx(energy[preset], rel=1e-3)


def test_the_collected_sweep_is_the_sweep_done_in_one_go(finished, tmp_path):
    """Or in two, as the second round looks where the first has found an edge."""
    plan = planned(finished).sweeps["steps"]
    scan, refined = tmp_path / "scan.h5", tmp_path / "refined.h5"
    compute_shard(plan, rounds.scan(plan), scan)
    compute_shard(plan, partition.refined(plan, rounds.judged(plan, [scan]), 1), refined)
    whole = collect((part for path in (scan, refined) for part in parts(path, 10)), plan.criteria, plan.config)
    xr.testing.assert_identical(open_file(finished.folder / "results/tiny/sweeps/steps/sweep.h5"), whole)


def test_the_table_says_what_the_file_says(finished):
    found = open_file(finished.folder / "results/tiny/sweeps/steps/frontier.h5")
    with (finished.folder / "results/tiny/sweeps/steps/frontier.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 2 * 3  # laws, criteria, stiffnesses
    for edge in ("first_pass", "last_fail"):
        told = [float(row[edge] or "nan") for row in rows]
        np.testing.assert_array_equal(told, found[edge].values.ravel())


def test_a_table_maps_the_shards_names_back(finished):
    with (finished.folder / "results/tiny/sweeps/steps/shards.csv").open() as file:
        rows = list(csv.DictReader(file))
    plan, cells = planned(finished).sweeps["steps"], {row["shard"]: int(row["cells"]) for row in rows}
    shards = partition.of(plan)
    assert cells.keys() == shards.keys()
    scanned = sum(cells[name] for name in partition.rounds(shards, 0))
    assert scanned == sum(len(plan.scan(column)) for column in plan.columns())
    assert sum(cells.values()) == open_file(finished.folder / "results/tiny/sweeps/steps/sweep.h5").sizes["cell"]


def test_a_rerun_with_nothing_changed_does_nothing(finished):
    before = {path: path.stat().st_mtime_ns for path in (finished.folder / "results").rglob("*")}
    done = finished.without_jobs()
    assert done.returncode == 0
    assert "Nothing to be done" in done.stdout + done.stderr
    assert "about" not in done.stderr
    assert before == {path: path.stat().st_mtime_ns for path in (finished.folder / "results").rglob("*")}


@pytest.mark.long
def test_a_changed_style_redraws_only(finished, edited):
    edited("src/stiffdice/report/figures/style.py", lambda text: text.replace('"font.size": 7', '"font.size": 8'))
    assert finished.jobs_due() == {"figure": 4, "animation": 1}


@pytest.mark.long
def test_a_changed_kernel_recomputes_what_it_touched(finished, edited):
    edited("src/stiffdice/dynamics/contact.py", lambda text: text.replace("push = times(fn", "push = times(1.0 * fn"))
    runs = {"trajectory": 3, "experiment": 2, "timing": 1}
    assert finished.jobs_due() == AGAIN | runs | {"figure": 4, "animation": 1}


@pytest.mark.long
def test_a_changed_analysis_computes_no_run_again(finished, edited):
    edited("src/stiffdice/sweep/stability_limits.py", lambda text: text + "\n")
    assert finished.jobs_due() == {"frontier": 1, "figure": 1, "table": 1}


@pytest.mark.long
def test_a_changed_scene_is_run_again(finished, edited):
    edited("config/scenes/figure-09.yaml", lambda text: text.replace("damping: 0.2", "damping: 0.3"))
    assert finished.jobs_due() == {"trajectory": 2, "experiment": 1, "figure": 2}


@pytest.mark.long
def test_a_changed_scene_of_the_sweep_is_swept_again(finished, edited):
    edited("config/scenes/figure-13.yaml", lambda text: text.replace("damping: 0.2", "damping: 0.3"))
    assert finished.jobs_due() == AGAIN


@pytest.mark.long
def test_a_changed_ensemble_leaves_single_runs_alone(finished, edited):
    edited("src/stiffdice/simulation/initial_conditions.py", lambda text: text + "\n")
    assert finished.jobs_due() == AGAIN


@pytest.mark.parametrize(
    ("script", "due"),
    [
        pytest.param("figure", {"figure": 4, "animation": 1}, marks=pytest.mark.broad),
        pytest.param("table", {"table": 1}, marks=pytest.mark.broad),
        pytest.param("measure", {"experiment": 2, "timing": 1, "figure": 2}, marks=pytest.mark.broad),
        ("collect", {"survey": 1, "collect": 1, "frontier": 1, "figure": 1, "table": 1}),
    ],
)
@pytest.mark.long
def test_a_changed_script_does_its_part_again(finished, edited, script, due):
    edited(f"workflow/scripts/{script}.py", lambda text: text + "\n")
    assert finished.jobs_due() == due


@pytest.mark.long
def test_a_touched_file_is_no_change(finished):
    for path in [*(finished.folder / "workflow" / "scripts").iterdir(), *(finished.folder / "config").rglob("*.yaml")]:
        path.touch()
    assert finished.jobs_due() == {}


@pytest.mark.long
def test_a_changed_tolerance_is_judged_not_computed(finished, edited):
    """Unless runs were stopped by the old one; only the second round is where the first has edges, which it moves."""
    edited("config/tiny.yaml", lambda text: text + "criteria: {apex: 0.5}\n")
    assert finished.jobs_due() == AGAIN | {"shard": 1}
    edited("config/tiny.yaml", lambda text: text.replace("early_stop: false", "early_stop: true"))
    assert finished.jobs_due() == AGAIN


@pytest.mark.long
def test_a_changed_drawing_draws_its_figure_only(finished, edited):
    edited("src/stiffdice/report/figures/bounces.py", lambda text: text + "\n")
    assert finished.jobs_due() == {"figure": 1}


def test_a_timing_keeps_its_times_where_benchmarks_are(finished):
    found = open_file(finished.folder / "results/tiny/benchmarks/timings/work.h5")
    assert (found.seconds.isel(effort=0) > 0).all()
    assert found.attrs["machine_cores"] >= 1


@pytest.mark.long
def test_changed_options_make_an_experiment_again(finished, edited):
    edited("config/tiny.yaml", lambda text: text.replace("- 20000", "- 30000"))
    assert finished.jobs_due() == {"experiment": 1, "figure": 1}


@pytest.mark.long
def test_a_changed_title_redraws_its_figure(finished, edited):
    edited("config/tiny.yaml", lambda text: text.replace("title: Position", "title: Place"))
    assert finished.jobs_due() == {"figure": 1}


@pytest.mark.long
def test_another_grid_is_computed(finished, edited):
    edited("config/tiny.yaml", lambda text: text.replace("members: 4", "members: 5"))
    assert finished.jobs_due() == AGAIN


@pytest.mark.long
def test_a_bad_study_is_one_line_status_2_and_nothing_written(finished, edited):
    edited("config/tiny.yaml", lambda text: text.replace("members: 4", "members: none"))
    done = finished.without_jobs()
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if not line.startswith("Using workflow specific profile")]
    assert lines == [
        "stiffdice: config/tiny.yaml: sweeps.steps.members = none: allowed is a whole number from 1 to 1000000"
    ]


@pytest.mark.parametrize(
    "name", ["../x", "nowhere", *(pytest.param(name, marks=pytest.mark.broad) for name in ("a b", "v1.5", ""))]
)
@pytest.mark.long
def test_a_study_that_is_not_there_is_one_line(finished, name):
    done = run_module("snakemake", "-n", "study", "--config", f"study={name}", cwd=finished.folder)
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if not line.startswith("Using workflow specific profile")]
    assert len(lines) == 1
    assert re.match(r"stiffdice: config/.*(letters, digits, hyphens and underscores|there is no study)", lines[0])


@pytest.mark.long
def test_another_study_does_not_mind_a_broken_paper(finished, edited):
    edited("config/paper.yaml", lambda text: "question: [")
    assert finished.jobs_due() == {}


@pytest.mark.long
def test_the_report_works_without_a_network(finished):
    done = finished.without_jobs("--report", "report.html")
    assert done.returncode == 0, done.stderr
    text = (finished.folder / "report.html").read_text()
    assert "Frontier" in text
    assert "first pass" in text
    assert "<script>alert" not in text and "Books &lt;/script&gt;" in text


def test_lint_finds_nothing(finished):
    done = run_module("snakemake", "--lint", cwd=finished.folder)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.broad
def test_another_simulator_finds_the_same_edges(tmp_path, monkeypatch):
    """In the same study; what needs one that is not installed is left out with a line."""
    project, steps = Project(tmp_path), TINY["sweeps"]["steps"]
    few = {**steps, "stiffness": 1e3, "contact": ["ungated"], "omega_h": {"from": 3.0, "to": 0.5, "count": 8}}
    sweeps = {"ours": few, "theirs": {**few, "simulator": "numpy"}, "missing": {**few, "simulator": "mujoco"}}
    figures = {"frontier": {"draw": "frontier", "of": [*sweeps], "title": "Frontier"}}
    project.plan({"question": "Do they agree?", "sweeps": sweeps, "figures": figures})
    (tmp_path / "absent").mkdir()
    (tmp_path / "absent" / "mujoco.py").write_text("raise ModuleNotFoundError")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "absent"))
    done = project.make("--cores", "2")
    assert done.returncode == 0, done.stderr
    told = "stiffdice: left out: sweeps.missing: simulator = mujoco: needs the package mujoco, which is not installed"
    assert done.stderr.count(told) == 1
    ours, theirs = (open_file(tmp_path / f"results/tiny/sweeps/{name}/frontier.h5") for name in ("ours", "theirs"))
    assert np.isfinite(ours.first_pass.values).all()
    for name in ("first_pass", "last_fail", "flips"):
        np.testing.assert_array_equal(theirs[name], ours[name])
    assert (tmp_path / "results/tiny/figures/frontier.svg").exists()
    assert not (tmp_path / "results/tiny/sweeps/missing").exists()
    assert project.jobs_due() == {}


@pytest.mark.broad
def test_neither_shard_size_nor_order_nor_a_kill_changes_a_number(finished, tmp_path):
    """kill -9 to Snakemake and all its jobs, at the moment the first shard is there."""
    other = Project(tmp_path)
    other.plan({**TINY, "sweeps": {"steps": rounds.asked_in_parts(TINY["sweeps"]["steps"], 5)}})
    running = subprocess.Popen(
        other.command(),
        cwd=other.folder,
        env=other.environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    deadline = time.monotonic() + 120
    while not other.results("sweeps/steps/shards/*.h5"):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    assert not other.results("sweeps/steps/sweep.h5")
    done = other.make("--cores", "1")
    assert done.returncode == 0, done.stderr
    assert len(other.results("sweeps/steps/shards/*.h5")) > len(finished.results("sweeps/steps/shards/*.h5"))
    assert other.results(*DATA) == finished.results(*DATA)


def test_where_the_time_went_is_told(made):
    assert re.search(r"^collect +1 +\d+\.\d s +0\.0 s$", made.stdout, re.MULTILINE)
    assert re.search(r"^\d+ s on 2 cores: \d+% of them simulation", made.stdout, re.MULTILINE)
    # Before it, how long it will take, of all jobs; and at last what to open.
    assert len(re.findall(r"^stiffdice: tiny: 18 jobs, about \d+ s on 2 cores", made.stderr, re.MULTILINE)) == 1
    assert made.stdout.splitlines()[-1] == f"open first: results/tiny/figures/books.svg ({TITLE})"
