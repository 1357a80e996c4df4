"""What `make sweep-million` promises: one physics at every size, numbers that are the files', and that it goes on."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from benchmarks.scale import peak
from benchmarks.scale.measures import Session, jobs_of, wall_of
from benchmarks.scale.run import Asked, measure
from benchmarks.scale.studies import extended, of_size, runs_of

from stiffdice.errors import InputError
from stiffdice.io import yaml_loader
from stiffdice.io.reader import open_file
from stiffdice.study import config as studies
from stiffdice.study import outputs
from stiffdice.sweep.grid import geometric

ROOT = Path(__file__).parents[2]
MILLION = ROOT / "config" / "million.yaml"
FEW = """\
question: Does it measure?
sweeps:
  sliding:
    scene: config/scenes/figure-13.yaml
    model: sliding
    contact: [ungated, gated]
    stiffness: {from: 1.0e+2, to: 1.0e+6, count: 32}
    omega_h: {from: 3.0, to: 0.1, count: 10}
    members: 4
"""


def test_a_million_is_a_million(monkeypatch):
    monkeypatch.chdir(ROOT)
    assert runs_of(studies.load(MILLION)) == pytest.approx(1e6, rel=0.01)


@pytest.mark.parametrize("share", [0.01, 0.1])
def test_a_smaller_study_has_fewer_grounds_and_the_same_physics(share):
    """They are spread as the many are: the mean of the logarithm, which the mean cost follows, stays where it is."""
    data = yaml_loader.load(MILLION)
    small = of_size(data, share)
    for name, sweep in small["sweeps"].items():
        before = data["sweeps"][name]
        assert sweep["stiffness"]["count"] == round(share * before["stiffness"]["count"])
        assert {**sweep, "stiffness": None} == {**before, "stiffness": None}
        few, many = (
            [math.log10(value) for value in geometric(part["stiffness"])] for part in (sweep, data["sweeps"][name])
        )
        assert sum(few) / len(few) == pytest.approx(sum(many) / len(many))
        assert few[0] - many[0] == pytest.approx((many[-1] - many[0]) / len(few) / 2)  # the middle of the first part
    assert {**small, "sweeps": None} == {**data, "sweeps": None}
    assert of_size(data, 1) == data


def test_an_extension_keeps_the_grid_and_goes_beyond_it():
    data = yaml_loader.load(MILLION)
    for name, sweep in extended(data)["sweeps"].items():
        before = data["sweeps"][name]
        grid, harder = sweep["stiffness"]
        assert grid == before["stiffness"]
        old, new = ([math.log10(value) for value in geometric(span)] for span in (grid, harder))
        assert new[0] - old[-1] == pytest.approx(old[1] - old[0])
        assert 0.4 < new[-1] - old[-1] < 0.6
        scan, denser = sweep["omega_h"]
        assert scan == before["omega_h"]
        assert scan["to"] < denser["to"] < denser["from"] < scan["from"]


def test_a_sweep_of_several_spans_cannot_be_made_smaller():
    span = {"from": 1e2, "to": 1e4, "count": 3}
    with pytest.raises(InputError, match=r"sweeps\.own\.stiffness = .*\{from, to, count\}"):
        of_size({"sweeps": {"own": {"stiffness": [span, span]}}}, 0.1)


@pytest.mark.long
def test_memory_is_that_of_the_process_asked_for_alone():
    """This one holds far more than the small one, and the kernel counts what a parent held when it started a child."""
    held = {}
    for megabytes in (0, 200):
        words = [sys.executable, "-S", "-c", f"x = bytearray({megabytes} * 10**6)"]
        done = subprocess.run([sys.executable, peak.__file__, *words], capture_output=True, text=True, check=True)
        held[megabytes] = int(done.stdout.split()[-1])
    assert held[0] < 40e6
    assert held[200] - held[0] == pytest.approx(200e6, rel=0.05)


def test_a_command_that_fails_is_not_measured():
    done = subprocess.run([sys.executable, peak.__file__, sys.executable, "-c", "raise SystemExit(3)"], check=False)
    assert done.returncode == 3


def test_a_killed_call_lasted_until_its_last_word(tmp_path):
    logs = tmp_path / "logs" / "shard"
    logs.mkdir(parents=True)
    for name, written in (("before", 900.0), ("first", 1003.0), ("last", 1007.0), ("next", 2004.0)):
        (logs / f"{name}.log").touch()
        os.utime(logs / f"{name}.log", (written, written))
    killed, ended = Session(1000.0, None), Session(2000.0, 5.0)
    assert wall_of([killed, ended], tmp_path) == pytest.approx(7 + 5)
    assert wall_of([Session(3000.0, None)], tmp_path) == 0


def million(folder: Path, study: Path) -> list[str]:
    asked = ["--runs", "320", "--workers", "0", "--extend", "0", "--folder", str(folder)]
    return [sys.executable, "-m", "benchmarks.scale", "--study", str(study), *asked]


def killed(folder: Path, study: Path) -> dict[Path, int]:
    """Start to measure, kill that when all shards are done, and return their files and times."""
    first = subprocess.Popen(million(folder, study), cwd=ROOT, stderr=subprocess.DEVNULL)
    while not (folder / "project/results/runs-320/logs/collect/sliding.log").exists():
        assert first.poll() is None
        time.sleep(0.05)
    first.send_signal(signal.SIGKILL)
    first.wait()
    return {path: path.stat().st_mtime_ns for path in folder.glob("project/results/runs-320/sweeps/*/shards/*.h5")}


@pytest.fixture(scope="module", params=[0, pytest.param(1, marks=pytest.mark.broad)], ids=["at once", "killed once"])
def measured(request, tmp_path_factory):
    """A small size, measured at once, or by a command that was killed before."""
    folder = tmp_path_factory.mktemp("scale")
    study = folder / "few.yaml"
    study.write_text(FEW)
    kept = killed(folder, study) if request.param else {}
    assert len(kept) >= request.param
    done = subprocess.run(million(folder, study), cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder, kept


@pytest.mark.long
@pytest.mark.workflow
def test_an_interrupted_measurement_goes_on_where_it_was(measured):
    folder, kept = measured
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    record = json.loads((folder / "record.json").read_text())
    assert record["runs-320"]["sessions"] == 1 + bool(kept)


@pytest.mark.long
@pytest.mark.workflow
def test_the_table_says_what_the_files_say(measured, monkeypatch):
    folder, _ = measured
    monkeypatch.chdir(ROOT)
    told = {
        (int(row["runs"]), row["quantity"]): float(row["value"])
        for row in csv.DictReader(io.StringIO((folder / "scale.csv").read_text()))
    }
    runs = 320
    top = folder / "project" / "results" / f"runs-{runs}"
    plan = studies.load(folder / f"project/config/runs-{runs}.yaml")
    assert told[runs, "runs"] == runs_of(plan) == 4 * open_file(top / "sweeps/sliding/sweep.h5").sizes["cell"]
    made = [result for result in outputs.of(plan) if result.stage == "shard"]
    assert told[runs, "shards"] == len(made) == len(list(top.rglob("shards/*.h5")))
    size = sum((top / file).stat().st_size for result in made for file in result.files)
    assert told[runs, "shard_bytes"] == pytest.approx(size / runs, rel=1e-5)
    jobs = jobs_of(plan, top)
    assert len(jobs) == told[runs, "jobs"]
    assert all(0 < job.simulation < job.seconds for job in jobs if job.stage == "shard")
    assert 100e6 < told[runs, "dag_peak"] * 1e6 < 500e6
    # A killed job's time counts for the workflow, and for no job.
    assert sum(told[runs, part] for part in ("simulation", "start_up", "snakemake")) == pytest.approx(100)
    assert told[runs, "simulation"] > 0


@pytest.mark.long
@pytest.mark.workflow
def test_what_is_measured_is_told_again_and_not_made_again(measured):
    folder, _ = measured
    page = (folder / "scale.md").read_text()
    before = {path: path.stat().st_mtime_ns for path in (folder / "project" / "results").rglob("*")}
    done = subprocess.run(million(folder, folder / "few.yaml"), cwd=ROOT, capture_output=True, text=True, check=True)
    assert page in done.stdout
    assert {path: path.stat().st_mtime_ns for path in (folder / "project" / "results").rglob("*")} == before


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"sizes": [0]}, "runs = 0: allowed is a whole number from 1"),
        ({"cores": 0}, "cores = 0: allowed is a whole number from 1"),
        ({"study": Path("config/extremes.yaml")}, "config/extremes.yaml: has no sweeps to measure"),
    ],
)
def test_what_cannot_be_measured_is_told_before_anything_is_made(tmp_path, monkeypatch, change, told):
    monkeypatch.chdir(ROOT)
    with pytest.raises(InputError, match=told):
        measure(Asked(MILLION, [100], 2, 0, 1, 0)._replace(**change), tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_a_study_that_is_not_there_is_one_line():
    words = [sys.executable, "-m", "benchmarks.scale", "--study", "config/no.yaml"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (2, "stiffdice: config/no.yaml: no such file\n")
