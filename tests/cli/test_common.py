"""Scenes by name: those that come with the package are those of a checkout, and a file goes before them."""

from __future__ import annotations

from pathlib import Path

import pytest

from stiffdice.cli import common
from stiffdice.io.reader import open_file
from stiffdice.scene import scene as scenes

CHECKOUT = Path(__file__).parents[2] / "config/scenes"


def test_the_scenes_in_the_package_are_those_of_the_checkout():
    """Change both: cp config/scenes/*.yaml src/stiffdice/scene/shipped/."""
    ours, theirs = ({path.name: path.read_text() for path in top.iterdir()} for top in (CHECKOUT, common.SCENES))
    assert ours == theirs


@pytest.mark.parametrize("name", ["figure-09", "figure-09.yaml", "config/scenes/figure-09.yaml"])
def test_a_scene_of_the_paper_runs_where_there_is_no_checkout(stiffdice, name):
    status, _, err, files = stiffdice("run", name, "--model", "sliding", "--steps", 1000, "-o", "x.h5")
    assert (status, files) == (0, ["x.h5"])
    assert f"{name}: no file here; taken is figure-09, which comes with stiffdice\n" in err
    assert open_file("x.h5").attrs["scene_digest"] == scenes.load(CHECKOUT / "figure-09.yaml").digest


def test_a_file_goes_before_the_scene_of_its_name(stiffdice, tmp_path):
    (tmp_path / "figure-09").write_text("duration: 0.5")
    status, out, err, _ = stiffdice("run", "figure-09", "--model", "sliding", "--steps", 100, "-o", "x.h5")
    assert status == 0 and "no file here" not in err and out
    assert open_file("x.h5").time.values[-1] == 0.5


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("figure-9", "figure-9: no such file; scenes that come with stiffdice are die, equal-cubes, figure-01"),
        ("figure-9", "figure-09?"),
        ("../figure-09.yaml", "../figure-09.yaml: No such file"),
        ("config/scenes/figure-99.yaml", "config/scenes/figure-99.yaml: No such file"),
    ],
)
def test_a_scene_that_is_nowhere_is_said_in_one_line(stiffdice, name, told):
    status, _, err, files = stiffdice("run", name, "-o", "x.h5")
    assert (status, err.count("\n"), files) == (2, 1, [])
    assert told in err


def test_commands_that_are_told_name_the_scene_as_a_person_would(stiffdice):
    status, out, _, _ = stiffdice("run", "figure-09", "--model", "sliding", "--steps", 1000, "-o", "x.h5")
    assert status == 0 and "stiffdice advise figure-09" in out
