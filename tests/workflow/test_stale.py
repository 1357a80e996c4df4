"""Results follow from what is asked now, whatever the times of files say, and whatever Snakemake has forgotten."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from tests.forks import run_module

pytestmark = pytest.mark.workflow
SWEPT = {"shard": 3, "survey": 1, "collect": 1, "frontier": 1, "figure": 1, "table": 1}


@pytest.fixture
def copied(made, tmp_path):
    """A copy for one test."""
    return made.copy(tmp_path / "project")


def forget(project):
    shutil.rmtree(project.folder / ".snakemake")


def change(project, name, before, after):
    """Change a file, and keep its time: an older one is put in its place."""
    path = project.folder / "config" / name
    text, stat = path.read_text(), path.stat()
    assert before in text
    path.write_text(text.replace(before, after))
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def stiffdice(project, *arguments):
    return run_module("stiffdice.cli", *arguments, cwd=project.folder, environment=project.environment)


def replaced_by_mv(old, new):
    os.utime(new, (time.time() - 3600,) * 2)
    new.rename(old)


def replaced_by_cp(old, new):
    os.utime(new, (time.time() - 3600,) * 2)
    shutil.copy2(new, old)


def replaced_by_tar(old, new):
    shutil.copystat(old, new)
    subprocess.run(["tar", "cf", "x.tar", new.name], cwd=new.parent, check=True)
    subprocess.run(["tar", "xf", "x.tar", "-C", old.parent], cwd=new.parent, check=True)


@pytest.mark.parametrize(
    ("replaced", "scene", "due"),
    [
        (replaced_by_mv, "figure-09", {"trajectory": 2, "experiment": 1, "figure": 2}),
        pytest.param(
            replaced_by_cp,
            "figure-01",
            {"trajectory": 1, "experiment": 1, "timing": 1, "figure": 1, "animation": 1},
            marks=pytest.mark.broad,
        ),
        (replaced_by_tar, "figure-13", SWEPT),
    ],
)
@pytest.mark.long
def test_an_older_scene_is_run(copied, tmp_path, replaced, scene, due):
    old, new = copied.folder / f"config/scenes/{scene}.yaml", tmp_path / f"{scene}.yaml"
    new.write_text(re.sub("damping: [0-9.]+", "damping: 0.3", old.read_text()))
    assert new.read_text() != old.read_text()
    replaced(old, new)
    assert copied.jobs_due() == due
    forget(copied)
    assert copied.jobs_due() == due


@pytest.mark.parametrize(
    ("before", "after", "due"),
    [
        ("steps: 10000\n", "steps: 20000\n", {"trajectory": 2, "figure": 1}),
        pytest.param("every: 2000", "every: 1000", {"trajectory": 1, "animation": 1}, marks=pytest.mark.broad),
        pytest.param("- 20000", "- 30000", {"experiment": 1, "figure": 1}, marks=pytest.mark.broad),
        pytest.param("rounds: 1", "rounds: 2", {"timing": 1, "figure": 1}, marks=pytest.mark.broad),
        pytest.param("members: 4", "members: 5", SWEPT, marks=pytest.mark.broad),
        ("early_stop: false", "early_stop: false\n    criteria: {energy: 0.2}", SWEPT | {"shard": 1}),
        ("title: Position", "title: Place", {"figure": 1}),
        pytest.param("title: Movie", "title: Film", {"animation": 1}, marks=pytest.mark.broad),
        pytest.param("title: Answers", "title: Replies", {"table": 1}, marks=pytest.mark.broad),
        pytest.param("question:", "dpi: 60\nquestion:", {"figure": 4, "animation": 1}, marks=pytest.mark.broad),
    ],
)
@pytest.mark.long
def test_another_study_is_run_though_snakemake_forgot(copied, before, after, due):
    change(copied, "tiny.yaml", before, after)
    forget(copied)
    assert copied.jobs_due() == due


@pytest.mark.long
def test_every_round_is_run_at_once_where_all_are_stale(copied):
    shutil.rmtree(copied.folder / "results/tiny/logs/shard")
    shutil.rmtree(copied.folder / "results/tiny/logs/survey")
    assert copied.jobs_due() == SWEPT


@pytest.mark.long
def test_the_same_study_is_not_run_though_snakemake_forgot(copied):
    forget(copied)
    for path in (copied.folder / "config").rglob("*.yaml"):
        path.touch()
    assert copied.jobs_due() == {}
    done = stiffdice(copied, "status", "tiny")
    assert done.returncode == 0, done.stdout
    assert stiffdice(copied, "verify", "results/tiny").returncode == 0


@pytest.mark.long
def test_what_is_asked_for_by_name_is_made_again_and_no_more(copied):
    change(copied, "tiny.yaml", "title: Position", "title: Place")
    change(copied, "tiny.yaml", "title: Books", "title: Ledger")
    forget(copied)
    asked = ("-n", "results/tiny/figures/books.svg")
    done = run_module("snakemake", *asked, cwd=copied.folder, environment=copied.environment)
    assert done.returncode == 0, done.stderr
    assert re.search(r"^figure +1\ntotal +1$", done.stdout + done.stderr, re.MULTILINE)


@pytest.mark.long
def test_what_is_stale_is_told_refused_and_made_again(copied):
    """And is as a study that was asked this from the start."""
    change(copied, "scenes/figure-09.yaml", "damping: 0.2", "damping: 0.3")
    forget(copied)
    run = "results/tiny/runs/stiff.as_listed.h5"
    told = stiffdice(copied, "status", "tiny")
    assert told.returncode == 3
    assert (
        "trajectory stiff.as_listed, trajectory stiff.as_written, experiment books  made from other scene"
        in told.stdout
    )
    assert "figure books, figure position  made from other inputs" in told.stdout
    told = stiffdice(copied, "verify", "results/tiny")
    assert told.returncode == 1
    assert "runs/stiff.as_listed.h5: stale: made from other scene" in told.stdout
    for name in ("CHANGELOG.md", "CITATION.cff", "LICENSE", "Makefile", "README.md", "pyproject.toml"):
        shutil.copy(Path(__file__).parents[2] / name, copied.folder)
    for name in ("requirements", "docs"):
        (copied.folder / name).mkdir()
    (copied.folder / "results/README.md").touch()
    told = stiffdice(copied, "archive", "tiny")
    assert (told.returncode, told.stderr.count("\n")) == (2, 1)
    assert f"{run}: made from other scene, as 5 of " in told.stderr
    before = copied.results("runs/stiff*.h5", "experiments/books.h5", "figures/position.svg", "figures/books.svg")
    others = copied.results(
        "runs/turn*",
        "experiments/work.h5",
        "sweeps/**/*.h5",
        "tables/*",
        "figures/frontier.*",
        "benchmarks/timings/*.h5",
    )
    done = copied.make("--cores", "2")
    assert done.returncode == 0, done.stderr
    assert all(content != before[name] for name, content in copied.results(*before).items())
    assert others == copied.results(*others)
    assert copied.jobs_due() == {}
    assert stiffdice(copied, "status", "tiny").returncode == 0
    assert stiffdice(copied, "verify", "results/tiny").returncode == 0


def swapped(project):
    """Put a whole file of another result in the place of one of each kind, as old as that; return which."""
    top = project.folder / "results/tiny"
    shard = (top / "sweeps/steps/shards.csv").read_text().splitlines()[1].split(",")[0]  # of the first round
    data, shown = top / "runs/turn.as_listed.h5", top / "figures/books.svg"
    files = {
        "runs/stiff.as_listed.h5": data,
        "experiments/books.h5": data,
        "benchmarks/timings/work.h5": data,
        f"sweeps/steps/shards/{shard}.h5": data,
        "sweeps/steps/surveys/0.h5": data,
        "sweeps/steps/sweep.h5": data,
        "sweeps/steps/frontier.csv": top / "tables/answers.csv",
        "figures/position.svg": shown,
        "figures/movie.gif": top / "figures/books.png",
        "tables/answers.md": shown,
    }
    for name, other in files.items():
        stat = (top / name).stat()
        shutil.copyfile(other, top / name)
        os.utime(top / name, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    return list(files)


@pytest.mark.long
def test_another_file_in_the_place_of_a_result_is_seen_of_every_kind(copied, tmp_path):
    names = swapped(copied)
    told = stiffdice(copied, "status", "tiny")
    assert told.returncode == 3
    assert "10 stale" in told.stdout
    assert "figure position  its .svg is not what its job made: another file in its place, or changed" in told.stdout
    more = {"shard": 1, "trajectory": 1, "experiment": 1, "timing": 1, "figure": 4, "animation": 1}
    assert copied.jobs_due() == SWEPT | more
    for folder in ("results/tiny", str(shutil.copytree(copied.folder / "results/tiny", tmp_path / "elsewhere"))):
        told = stiffdice(copied, "verify", folder)
        assert told.returncode == 1
        failing = [line for line in told.stdout.splitlines() if "not what its job made" in line]
        assert len(failing) == len(names)


@pytest.mark.broad
def test_a_figure_that_was_touched_up_is_set_aside_and_made_again(copied):
    figure = copied.folder / "results/tiny/figures/position.png"
    before = figure.read_bytes()
    figure.write_bytes(b"touched up")
    done = copied.snakemake()
    assert done.returncode == 0, done.stderr
    line = "results/tiny/figures/position.png: not what its job made: another file in its place, or changed by hand; "
    assert f"stiffdice: {line}set aside as position.png.damaged, and made again\n" in done.stderr
    assert figure.read_bytes() == before
    assert figure.with_name("position.png.damaged").read_bytes() == b"touched up"
    assert copied.jobs_due() == {}


@pytest.mark.long
def test_a_log_that_is_gone_tells_nothing(copied):
    (copied.folder / "results/tiny/logs/experiment/books.log").unlink()
    assert copied.jobs_due() == {"experiment": 1, "figure": 1}
    assert "experiment books  no log says what it was made from" in stiffdice(copied, "status", "tiny").stdout
