"""Figures, tables and the page of real tosses, from measurements of a few."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tests import toss_files
from tests.report.figures.drawing import check_equal_files, check_units, drawn, lines_of

from stiffdice.experiments.tosses import chaos, fit, models, single, steps
from stiffdice.experiments.tosses.summary import summary_of
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report import toss_page
from stiffdice.report.figures import registry
from stiffdice.report.figures import tosses as drawing
from stiffdice.report.tables.tosses import VARIANT_WORDS
from stiffdice.study.catalogue import TABLES

FEW = {
    "toss-fit": lambda data: fit.measure(toss_files.SCENE, data=data, contact_time=(0.005, 0.01)),
    "toss-models": lambda data: models.measure(toss_files.SCENE, data=data),
    "toss-steps": lambda data: steps.measure(
        toss_files.SCENE, data=data, contact_time=(0.005, 0.01), omega_h=(0.1, 3.0), count=6
    ),
    "toss-chaos": lambda data: chaos.measure(toss_files.SCENE, data=data, sizes=(1.0, 10.0), draws=5),
    "toss": lambda data: single.measure(toss_files.SCENE, data=data),
}
FIGURES = {
    "toss-fit": "toss-fit",
    "toss-time": "toss-models",
    "toss-steps": "toss-steps",
    "toss-chaos": "toss-chaos",
}


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    path = toss_files.stored(toss_files.some(6), tmp_path_factory.mktemp("tosses") / "few.h5")
    return {name: measure(str(path)) for name, measure in FEW.items()}


@pytest.mark.long
@pytest.mark.parametrize("name", FIGURES)
def test_figures_have_units(found, name):
    figure = drawn(name, {"x": found[FIGURES[name]]})
    if name != "toss-fit":  # which has subfigures of its own
        check_units(figure)


@pytest.mark.broad
@pytest.mark.parametrize("name", FIGURES)
def test_equal_data_give_equal_files(found, name, tmp_path):
    check_equal_files(name, {"x": found[FIGURES[name]]}, tmp_path)


@pytest.mark.long
def test_every_curve_of_the_steps_is_the_mean_over_tosses(found):
    data = found["toss-steps"]
    panels = drawn("toss-steps", {"x": data}).axes[:3]
    for panel, (name, _, _, factor) in zip(panels, drawing._CRITERIA.values(), strict=True):
        shown = [np.asarray(line.get_ydata()) for line in panel.get_lines()]
        for k in range(2):
            assert any(np.array_equal(line, factor * data[name][k].mean("toss")) for line in shown)


@pytest.mark.long
def test_errors_over_time_are_drawn_for_every_variant(found):
    upper, lower = drawn("toss-time", {"x": found["toss-models"]}).axes[:2]
    assert set(lines_of(upper)) == set(lines_of(lower)) == set(VARIANT_WORDS.values())
    assert set(models.VARIANTS) == set(VARIANT_WORDS)


@pytest.mark.long
def test_the_animation_shows_both_cubes_at_their_samples(found):
    animation = drawn("toss-animation", {"x": found["toss"]})
    last = animation.show(animation.frames - 1)
    cubes = [artist for artist in last if hasattr(artist, "_segments3d")]
    ends = [np.unique(np.round(np.asarray(cube._segments3d).reshape(-1, 3), 9), axis=0) for cube in cubes]
    for name, nodes in zip(("measured", "simulated"), ends, strict=True):
        wanted = np.unique(np.round(found["toss"][f"{name}_nodes"].values[-1], 9), axis=0)
        np.testing.assert_allclose(nodes, wanted, atol=1e-8)


@pytest.mark.long
def test_the_animation_is_a_gif(found, tmp_path):
    registry.draw("toss-animation", {"x": found["toss"]}, "A title", 40, [str(tmp_path / "a.gif")])
    assert (tmp_path / "a.gif").read_bytes().startswith(b"GIF8")


@pytest.mark.long
@pytest.mark.parametrize(("name", "rows"), [("toss-fit", 4), ("toss-models", 10), ("toss-steps", 6), ("toss-chaos", 4)])
def test_tables_have_a_row_for_each(found, name, rows):
    table = TABLES[name].load()({"x": found[name]}, "A title")
    assert len(table.csv.splitlines()) == rows + 1
    assert "nan" not in table.markdown


@pytest.mark.long
def test_a_row_of_the_models_is_the_mean_and_its_interval(found):
    data = found["toss-models"]
    table = TABLES["toss-models"].load()({"x": data}, "A title")
    k = meanings_of(data.variant).index("solid_inertia")
    path = 100 * data.path[k].values
    row = next(line for line in table.csv.splitlines() if line.startswith("inertia of a solid cube"))
    assert f"{path.mean():.1f} ± {1.96 * path.std() / np.sqrt(len(path)):.1f}" in row


@pytest.mark.long
def test_the_page_says_what_was_found():
    over: list[float] = []
    summary = summary_of(toss_files.some(9), toss_files.SCENE, 0.005, 18, lambda _, part: over.append(part))
    text = toss_page.as_text("few.h5", summary)
    assert text.startswith("few.h5: 9 tosses of a cube of 104.8 mm and 0.37 kg, 148 Hz")
    assert "fitted on 3 random tosses, contact time 5 ms:" in text
    assert f"{summary.fit.friction:.3f}" in text
    data = json.loads(toss_page.as_json("few.h5", summary))
    assert data["friction"]["best"] == summary.fit.friction
    assert data["told"]["sample"]["path_sides"]["mean"] == pytest.approx(summary.told["sample"].path.mean())
    assert len(over) >= 5
    assert over == sorted(over), "the time that is over only grows"
    assert 0 == over[0] < over[-1] < 1
