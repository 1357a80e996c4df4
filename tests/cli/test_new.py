"""What `new` writes can be run as it is, and nothing of a person's own is lost."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from stiffdice.scene.scene import PRESETS, from_mapping, load
from stiffdice.study import config

ROOT = Path(__file__).parents[2]
SCENES = sorted(path for path in (ROOT / "config/scenes").glob("*.yaml") if "cubes" not in path.read_text())


@pytest.fixture
def project(tmp_path):
    """The folder of the tests as a project's."""
    shutil.copytree(ROOT / "config/scenes", tmp_path / "config/scenes")
    return tmp_path


def test_outside_of_a_project_a_scene_is_written_that_runs(stiffdice):
    status, out, err, files = stiffdice("new", "my-cube")
    assert (status, err, files) == (0, "", ["my-cube.yaml"])
    assert out == "my-cube.yaml\n  stiffdice run my-cube.yaml -o my-cube.h5\n"
    assert load("my-cube.yaml") == from_mapping({}, "as_written")
    assert stiffdice("run", "my-cube.yaml", "--model", "sliding", "--steps", "2000", "-o", "my-cube.h5")[0] == 0


@pytest.mark.parametrize("source", [*PRESETS, *(pytest.param(path, id=path.stem) for path in SCENES[-3:])])
def test_a_scene_is_what_it_was_begun_from(stiffdice, source):
    assert stiffdice("new", "mine", "--from", source)[0] == 0
    text = Path("mine.yaml").read_text()
    stated = {"cube": {"inertia": "corners"}} if source == "corrected" else {}
    assert load("mine.yaml") == (from_mapping(stated, source) if source in PRESETS else load(source))
    for line in text.splitlines():
        assert not line or line.startswith("#") or re.search(r"  # .{5}", line), line


@pytest.mark.long
@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_a_study_of_any_scene_is_one(stiffdice, project, path):
    status, out, _, _ = stiffdice("new", "mine", "--from", f"config/scenes/{path.name}")
    assert status == 0
    assert out.splitlines()[:2] == ["config/scenes/mine.yaml", "config/mine.yaml"]
    study = config.load("config/mine.yaml")
    assert list(study.figures) == ["position", "energy", "frontier"]
    assert study.left_out == ()
    assert load("config/scenes/mine.yaml") == load(path)
    plan = yaml.safe_load(Path("config/mine.yaml").read_text())
    assert plan["runs"]["mine"]["scene"] == "config/scenes/mine.yaml"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["a b"], "NAME = a b: allowed are letters, digits, hyphens and underscores"),
        (["../x"], "NAME = ../x: allowed are"),
        (["x", "--from", "nowhere.yaml"], "nowhere.yaml: No such file"),
        (["x", "--from", ROOT / "config/scenes/two-cubes.yaml"], "cubes: allowed here is a scene of one cube"),
    ],
)
def test_what_cannot_be_begun_is_one_line(stiffdice, words, told):
    status, out, err, files = stiffdice("new", *words)
    assert (status, out, files, err.count("\n")) == (2, "", [], 1)
    assert told in err


@pytest.mark.parametrize("there", ["config/scenes/mine.yaml", "config/mine.yaml"])
def test_nothing_is_replaced_and_nothing_is_half_done(stiffdice, project, there):
    (project / there).write_text("mine")
    status, _, err, _ = stiffdice("new", "mine")
    assert (status, err) == (2, f"stiffdice: {there}: is there already; name another, or remove it\n")
    assert (project / there).read_text() == "mine"
    assert sum((project / name).exists() for name in ("config/scenes/mine.yaml", "config/mine.yaml")) == 1


@pytest.mark.broad  # docs/tutorial/first-study.md has that of the paper's scene made
@pytest.mark.workflow
def test_the_study_gives_its_figures(stiffdice, project):
    for name in ("Snakefile", "workflow", "src", "requirements", "pyproject.toml"):
        source, target = ROOT / name, project / name
        shutil.copytree(source, target, dirs_exist_ok=True) if source.is_dir() else shutil.copy(source, target)
    assert stiffdice("new", "mine", "--from", "config/scenes/die.yaml")[0] == 0
    words = ["--workflow-profile", "workflow/profiles/default", "--config", "study=mine"]
    command = [sys.executable, "workflow/run.py", "--cores", "1", "study", *words]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    figures = {path.stem for path in (project / "results/mine/figures").iterdir()}
    assert figures == {"position", "energy", "frontier"}
