"""The page is one file without a network, of parts that do not disturb each other."""

from __future__ import annotations

import json
import re
from importlib import resources

import pytest

from stiffdice.errors import InputError
from stiffdice.report.explorer import page, scene_data
from stiffdice.scene import die
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.landing import faces_of


@pytest.fixture(scope="module")
def text(explorer):
    return explorer.read_text()


def test_it_holds_all_that_it_needs(text):
    assert len(text.encode()) <= 4_000_000
    assert not re.search(r"<(script|link|img|iframe)[^>]*(src|href)=(?!\"data:)", text), (
        "nothing is loaded from elsewhere"
    )
    assert "default-src 'none'" in text, "and the browser is told to load nothing"
    assert not re.search(r"<!-- [A-Z]+ -->", text), "every part is filled in"


def test_it_is_the_same_page_every_time(explorer, tmp_path):
    page.write(tmp_path, tmp_path / "again.html")
    assert (tmp_path / "again.html").read_bytes() == explorer.read_bytes()


def test_a_page_that_is_too_large_says_which_part_is(tmp_path, monkeypatch):
    monkeypatch.setattr(page, "MOST_BYTES", 1_000_000)
    with pytest.raises(
        InputError, match=r"explorer: 2,\d+,\d+ bytes \(style .* plotly 1,\d+,\d+.*\); allowed are at most"
    ):
        page.write(tmp_path, tmp_path / "explorer.html")
    assert not (tmp_path / "explorer.html").exists()


def test_no_two_scripts_declare_one_name():
    assets = resources.files("stiffdice.report.explorer") / "assets"
    names = [
        name
        for script in page.SCRIPTS
        for name in re.findall(r"^(?:async )?(?:function|const|let|class) (\w+)", (assets / script).read_text(), re.M)
    ]
    assert len(names) == len(set(names)), sorted({name for name in names if names.count(name) > 1})
    assert {file.name for file in assets.iterdir() if file.name.endswith(".js")} == set(page.SCRIPTS)


def test_data_cannot_end_their_element():
    given = {"text": "</script><!--"}
    told = page._embedded(given)
    assert "<" not in told
    assert json.loads(told) == given


def test_the_die_is_that_of_stiffdice_throw(tmp_path):
    told = page.data_of(tmp_path)["die"]
    scene = from_mapping(die.SCENE, "as_written")
    assert told["barrier"] == faces_of(scene).barrier.tolist()
    assert told["scene"]["stiffness"] == scene.ground.stiffness
    assert told["scene"]["gated"]


def test_a_model_that_the_page_does_not_compute_is_refused():
    with pytest.raises(InputError, match="model = vertical: the page computes sliding and tumbling"):
        scene_data.plain(from_mapping({}), "vertical")


def test_a_body_that_the_page_does_not_compute_is_refused():
    with pytest.raises(InputError, match=r"allowed here is a cube that has the same"):
        scene_data.plain(from_mapping({"cube": {"sides": [1, 1, 2]}}), "tumbling")
