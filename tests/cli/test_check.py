from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from PIL import Image
from tests.mjcf_files import ball, scene, written

from stiffdice.cli.main import main

MODEL = Path(__file__).parents[2] / "config" / "models" / "ball.xml"


def called(capsys, *arguments):
    try:
        status = main(["check", *map(str, arguments)])
    except SystemExit as end:
        status = end.code
    out, err = capsys.readouterr()
    return status, out, [line for line in err.splitlines() if not line.startswith("check:")]  # of a slow machine


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("no xml", "not an XML file (syntax error: line 1, column 0)"),
        ("<robot/>", "is a URDF; allowed is a model in MuJoCo's MJCF, <mujoco>"),
    ],
)
def test_what_cannot_be_checked_is_one_line_and_status_2(text, words, capsys, tmp_path):
    status, out, err = called(capsys, written(text, tmp_path))
    assert (status, out) == (2, "")
    assert err == [f"stiffdice: {tmp_path}/model.xml: {words}"]


def test_without_mujoco_it_is_one_line_and_status_2(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    status, out, err = called(capsys, MODEL)
    assert (status, out) == (2, "")
    assert err == [f"stiffdice: {MODEL}: needs the package mujoco, which is not installed; make install-engines"]


def test_a_missing_mesh_is_one_line_and_status_2(capsys, tmp_path):
    pytest.importorskip("mujoco")
    status, out, err = called(capsys, written('<mujoco><asset><mesh file="gone.stl"/></asset></mujoco>', tmp_path))
    assert (status, out, len(err)) == (2, "", 1)
    assert "gone.stl" in err[0]


def test_a_model_in_which_nothing_falls_is_one_line_and_status_2(capsys, tmp_path):
    pytest.importorskip("mujoco")
    status, out, err = called(capsys, written(scene(""), tmp_path))
    assert (status, out, len(err)) == (2, "", 1)
    assert "nothing to check" in err[0]


@pytest.mark.parametrize("figure", ["a.pdf", "gone/a.png"])
def test_a_figure_that_cannot_be_drawn_is_told_before_anything_is_run(figure, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, _, err = called(capsys, "gone.xml", "--figure", figure)
    assert (status, len(err)) == (2, 1)
    assert figure.partition("/")[0] in err[0]


@pytest.mark.long
def test_a_model_with_something_wrong_its_patch_its_numbers_and_its_figure(capsys, tmp_path):
    pytest.importorskip("mujoco")
    status, out, err = called(capsys, MODEL, "--figure", tmp_path / "a.png")
    assert (status, err) == (1, [])
    for words in ("1 of 1 contacts with something wrong", "will gain energy", '+  <option timestep="0.002"/>'):
        assert words in out
    with Image.open(tmp_path / "a.png") as image:
        assert image.size[0] > 800
    status, out, _ = called(capsys, MODEL, "--json")
    content = json.loads(out)
    assert (status, content["passed"]) == (1, False)
    status, patch, _ = called(capsys, MODEL, "--patch")
    assert (status, patch) == (1, content["patch"])


@pytest.mark.long
def test_a_model_that_is_fine(capsys, tmp_path):
    pytest.importorskip("mujoco")
    status, out, err = called(capsys, written(ball(), tmp_path))
    assert (status, err) == (0, [])
    assert "nothing wrong" in out
    assert called(capsys, written(ball(), tmp_path), "--patch")[:2] == (0, "")
