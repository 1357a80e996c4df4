"""`stiffdice infer`: a page, the same for programs, and one line for counts that are none."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from stiffdice.cli.main import main
from stiffdice.experiments.dice import response, response_table
from stiffdice.io.writer import write_dataset
from stiffdice.scene import scene as scenes

ROOT = Path(__file__).parents[2]
LABBY = "config/measurements/labby-2009.yaml"


@pytest.fixture
def infer(capsys, monkeypatch, tmp_path):
    """Call the command in a folder with the project's config/."""
    shutil.copytree(ROOT / "config", tmp_path / "config")
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        status = main(["infer", *map(str, arguments)])
        return status, *capsys.readouterr()

    return call


def test_the_page_names_rolls_axes_and_where_the_numbers_are_from(infer):
    status, out, err = infer(LABBY)
    assert (status, err) == (0, "")
    for words in ("315,672: 53222,", "CHANCE 22(4)", "χ² = 24.7", "1.6×10⁻⁴", "1-6  ", "towards", "95% interval"):
        assert words in out, words
    assert "what comes with stiffdice (make shapes); thrown: dropped, tossed, rolled; e = 0.3 to 0.6, μ = 0.1 to" in out
    assert infer(LABBY)[1] == out, "the same again"


def test_a_throw_that_is_known_narrows_the_answer(infer):
    whole, known = (json.loads(infer(LABBY, "--json", *words)[1]) for words in ([], ["--throw", "rolled"]))
    assert known["response"]["throws"] == ["rolled"]
    spread = [found["axes"]["1-6"]["length_over_others_less_one"]["standard_deviation"] for found in (whole, known)]
    assert spread[1] < 0.6 * spread[0]
    status, _, err = infer(LABBY, "--throw", "kicked")
    assert (status, err) == (2, "stiffdice: --throw = kicked: allowed is dropped or tossed or rolled\n")


def test_json_says_the_same(infer):
    status, out, _ = infer("config/measurements/wolf-white.yaml", "--json")
    found = json.loads(out)
    assert (status, found["longest_axis"], found["counts"][0]) == (0, "3-4", 3246)
    axis = found["axes"]["3-4"]
    assert axis["length_over_others_less_one"]["low"] > 0.02
    assert axis["offset_over_side"]["towards_face"] == 3
    assert found["response"]["chi"]["low"] < found["response"]["chi"]["median"] < -2


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("counts: [1, 2, -3, 4, 5, 6]", "counts[3] = -3"),
        ("counts: [1, 2, 3.5, 4, 5, 6]", "counts[3] = 3.5"),
        ("counts: [1, 2, 3]", "allowed are six whole numbers"),
        ("counts: [0, 0, 0, 0, 0, 0]", "one roll at least"),
        ("counts: [1, 2, 3, 4, 5, 6]\nrolls: 21", "rolls: unknown key"),
    ],
)
def test_bad_counts_are_one_line_and_status_2(infer, text, told):
    Path("bad.yaml").write_text(text)
    status, out, err = infer("bad.yaml")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("stiffdice: bad.yaml: ")
    assert told in err


def test_files_that_are_not_there_are_said(infer):
    status, _, err = infer("nowhere.yaml")
    assert (status, err.count("\n")) == (2, 1)
    assert "nowhere.yaml" in err


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("friction: [0.1, 0.2, 0.3]", "friction: [0.3, 0.2, 0.1]", "friction: allowed are numbers in ascending order"),
        ("    chi:", "    chy:", "chy: unknown key"),
        ("stretch: 0.2", "stretch: -1", "stretch = -1"),
    ],
)
def test_a_response_that_is_none_is_said(infer, monkeypatch, old, new, told):
    text = response_table.SHIPPED.read_text()
    assert old in text
    Path("response.yaml").write_text(text.replace(old, new, 1))
    monkeypatch.setattr(response_table, "SHIPPED", Path("response.yaml"))
    status, _, err = infer(LABBY)
    assert (status, err.count("\n")) == (2, 1)
    assert "response.yaml: " in err
    assert told in err


@pytest.mark.long
def test_a_response_of_ones_own_is_taken(infer):
    scene = scenes.load("config/scenes/thrown-die.yaml")
    found = response.measure(scene, restitution=[0.3, 0.6], friction=[0.2], throws=2000)
    write_dataset(found, "mine.h5")
    status, out, _ = infer(LABBY, "--response", "mine.h5", "--json")
    assert status == 0
    told = json.loads(out)["response"]
    assert told["throws"] == ["mine"]
    assert told["chi"]["median"] == pytest.approx(float(found.chi.mean()), abs=3 * float(np.max(found.chi_error)))
    write_dataset(response.launches(scene, speed=[1.0], spin=[30.0], throws=500), "other.h5")
    status, _, err = infer(LABBY, "--response", "other.h5")
    assert (status, err.count("\n")) == (2, 1)
    assert "other.h5: no file of the experiment face-response" in err
