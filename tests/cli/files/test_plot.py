"""Any file of ours is drawn by the figures that studies have."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
import xarray as xr

from stiffdice.cli import common
from stiffdice.report import file_figure
from stiffdice.study.catalogue import DRAWINGS

ROOT = Path(__file__).parents[3]
SCENE = ROOT / "config/scenes/figure-04.yaml"
PAIR = ROOT / "config/scenes/two-cubes.yaml"
HEADS = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF", ".gif": b"GIF8"}


@pytest.fixture
def throw(stiffdice, tmp_path):
    stiffdice("run", SCENE, "--steps", "2000", "-o", "throw.h5", "-q")
    return "throw.h5"


@pytest.mark.long
def test_a_figure_lies_beside_its_file(stiffdice, tmp_path, throw):
    (tmp_path / "a folder").mkdir()
    shutil.move(throw, tmp_path / "a folder" / "my throw.h5")
    status, out, _, _ = stiffdice("plot", "a folder/my throw.h5", "-q")
    assert status == 0
    told = "position; --draw has energy, cube-end, cube-start, cube-middle, animation, too"
    assert out == f"a folder/my throw.png: {told}\n"
    assert (tmp_path / "a folder/my throw.png").read_bytes().startswith(HEADS[".png"])


@pytest.mark.long
@pytest.mark.parametrize(("drawing", "ending"), [("energy", ".svg"), ("cube-end", ".pdf"), ("animation", ".gif")])
def test_ending_and_drawing_can_be_chosen(stiffdice, tmp_path, throw, drawing, ending):
    assert stiffdice("plot", throw, "--draw", drawing, "-o", f"x{ending}", "-q")[0] == 0
    assert (tmp_path / f"x{ending}").read_bytes().startswith(HEADS[ending])
    assert common._is_our_picture(tmp_path / f"x{ending}")
    if ending == ".svg":
        assert stiffdice("plot", throw, "--draw", drawing, "-q")[3] == ["throw-energy.png", "throw.h5", "x.svg"]


@pytest.mark.long
def test_two_cubes_are_drawn(stiffdice):
    stiffdice("run", PAIR, "--steps", "500", "-o", "two.h5", "-q")
    assert stiffdice("plot", "two.h5", "-q")[1].startswith("two.png: cube-end; ")


def test_every_drawing_of_one_file_is_some_files():
    """What the catalogue can draw of a single file, a file can be drawn as; but what compares several cannot."""
    found = set()
    for measure in {entry.measures for entry in DRAWINGS.values() if entry.measures}:
        for kind in ("experiment", "timing"):
            told = {"kind": kind, "config": json.dumps({"measure": measure})}
            found |= set(file_figure.drawings_of(xr.Dataset(attrs=told)))
    run = xr.Dataset({"node_offset": 0.0}, attrs={"kind": "run"})
    found |= set(file_figure.drawings_of(run))
    for stiffness in ([1.0], [1.0, 2.0]):
        sweep = xr.Dataset(coords={"stiffness": stiffness}, attrs={"kind": "frontier"})
        found |= set(file_figure.drawings_of(sweep))
    assert set(DRAWINGS) - found == {"refinement-check"}


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["throw.h5", "--draw", "enrgy"], "throw.h5: --draw = enrgy: allowed is position or energy"),
        (
            ["throw.h5", "-o", "x.jpg"],
            "-o = x.jpg: allowed is the name of a file that ends in .png, .svg, .pdf or",
        ),
        (["throw.h5", "-o", "x.gif"], "-o = x.gif: allowed is the name of a file that ends in .png, .svg or .pdf"),
        (["throw.h5", "-o", "nowhere/x.png"], "nowhere/x.png: the folder nowhere does not exist"),
        (["nowhere.h5"], "nowhere.h5: No such file"),
        (["."], ".: Is a directory"),
    ],
)
def test_what_cannot_be_drawn_is_one_line(stiffdice, throw, words, told):
    status, out, err, files = stiffdice("plot", *words, "-q")
    assert (status, out, files, err.count("\n")) == (2, "", ["throw.h5"], 1)
    assert told in err


def test_a_file_without_a_figure_says_which_have_one():
    shard = xr.Dataset(attrs={"kind": "shard", "config": "{}"})
    with pytest.raises(file_figure.InputError, match=r"a.h5: kind = shard: .*allowed is run, .*bounce-map"):
        file_figure.chosen(shard, "a.h5", None)


@pytest.mark.long
def test_a_picture_of_ones_own_is_kept(stiffdice, tmp_path, throw):
    (tmp_path / "throw.png").write_bytes(HEADS[".png"] + b" of a cat")
    status, _, err, _ = stiffdice("plot", throw, "-q")
    assert status == 2
    assert "throw.png: is there already" in err
    assert stiffdice("plot", throw, "-q", "--force")[0] == 0
    assert stiffdice("plot", throw, "-q")[0] == 0, "a figure of stiffdice is replaced"


def test_no_viewer_is_one_line(stiffdice, throw, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    status, _, err, files = stiffdice("plot", throw, "--show")
    assert (status, files) == (2, ["throw.h5"])
    assert "is not installed; open the figure yourself" in err
