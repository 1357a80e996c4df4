from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.report.figures.drawing import check_equal_files, check_units, drawn

from stiffdice.experiments.dice import response, shapes
from stiffdice.report.tables import dice as tables
from stiffdice.scene import scene as scenes

pytestmark = pytest.mark.long

SCENE = scenes.load(Path(__file__).parents[3] / "config/scenes/thrown-die.yaml")
MEASURED = {"measured_aspect": [0.8, 1.2], "measured_part": [0.5, 0.2], "measured_throws": [100, 200]}


@pytest.fixture(scope="module")
def boxes():
    return shapes.measure(SCENE, aspect=[0.5, 1.0, 2.0], friction=[0.1, 0.3], throws=200, **MEASURED)


@pytest.fixture(scope="module")
def coefficients():
    return response.measure(SCENE, restitution=[0.3, 0.6], friction=[0.1, 0.3], throws=500)


@pytest.fixture(scope="module")
def by_launch():
    return response.launches(SCENE, speed=[0.0, 1.0], spin=[10.0, 30.0], steps=20_000, throws=500)


def test_simulation_models_and_measurements_are_drawn(boxes, tmp_path):
    figure = drawn("box-faces", {"ends": boxes})
    check_units(figure)
    (legend,) = figure.legends
    assert len(legend.get_texts()) == 6
    curves = [np.asarray(line.get_ydata()) for line in figure.axes[0].get_lines()]
    for name in ("solid_angle", "gibbs", "pender_uhrin"):
        assert any(np.array_equal(curve, boxes[name]) for curve in curves), name
    assert any(np.array_equal(curve, boxes.end_pair.sel(restitution=0.45, friction=0.3)) for curve in curves)
    assert any(np.array_equal(curve, [0.5, 0.2]) for curve in curves)
    check_equal_files("box-faces", {"ends": boxes}, tmp_path)


def test_without_measurements_there_are_none(boxes):
    alone = boxes.drop_dims("specimen")
    assert len(drawn("box-faces", {"ends": alone}).legends[0].get_texts()) == 5


def test_coefficients_are_drawn_for_each_throw_and_ground(coefficients, by_launch):
    figure = drawn("face-response", {"tossed": coefficients, "rolled": coefficients})
    check_units(figure)
    assert any("tossed: 1 ± 0.3 m/s, spin 0 ± 30 rad/s" in text.get_text() for text in figure.legends[0].get_texts())
    for panel, name in zip(figure.axes, ("chi", "psi"), strict=True):
        curves = [np.asarray(line.get_ydata()) for line in panel.get_lines()]
        assert sum(np.array_equal(curve, coefficients[name][0]) for curve in curves) == 2
    figure = drawn("launch-response", {"launches": by_launch})
    check_units(figure)
    curves = [np.asarray(line.get_ydata()) for line in figure.axes[1].get_lines()]
    assert any(np.array_equal(curve, by_launch.psi[1]) for curve in curves)


def test_tables_have_a_row_for_each_ground_and_each_check(coefficients):
    table = tables.response({"tossed": coefficients}, "A title")
    rows = [line for line in table.markdown.splitlines() if line.startswith("| tossed")]
    assert len(rows) == 4
    assert f"{float(coefficients.chi[0, 0]):.3f}".replace("-", "−") in rows[0]
    checked = tables.checks({"checks": response.checks(SCENE, throws=300)}, "A title")
    assert len(checked.csv.splitlines()) == 9
    assert "steps of 0.1 ms, contact time 1 ms; 300 throws" in checked.markdown
