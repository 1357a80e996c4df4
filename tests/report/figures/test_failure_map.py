from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.patches import Rectangle

from stiffdice.experiments import failure_map
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import failure_map as drawing
from stiffdice.report.figures import style
from stiffdice.scene.scene import Scene
from stiffdice.simulation.outcome import Verdict

STEPS = [1.0, 10.0, 100.0, 1e3, 1e4, 1e5]


@pytest.fixture(scope="module")
def data():
    scene = Scene().with_ground(friction=0.0)
    options = {"damping": {"values": [0.0, 1.0, 10.0, 1e3]}, "start": {}, "mass": {"values": [0.01, 1.0, 1e6]}}
    return {axis: failure_map.measure(scene, axis=axis, steps=STEPS, **more) for axis, more in options.items()}


@pytest.fixture(scope="module")
def figure(data):
    with style.applied():
        return drawing.draw(data, "A title")


def shown(panel, x, y):
    """The colour of a panel at a point, in its axes' numbers."""
    for patch in panel.patches:
        if isinstance(patch, Rectangle) and patch.get_bbox().contains(x, y):
            return to_hex(patch.get_facecolor())
    return None


def test_axes_have_units(figure):
    assert len(figure.axes) == 6
    for k, panel in enumerate(figure.axes):
        assert "[" in panel.get_xlabel()
        assert k % 2 or "[" in panel.get_ylabel()


@pytest.mark.parametrize("axis", ["damping", "start", "mass"])
def test_every_cell_has_its_verdicts_colour(data, figure, axis):
    dataset = data[axis]
    pair = figure.axes[2 * list(data).index(axis) :][:2]
    heights = drawing._rows(dataset)
    for (law, row, k), verdict in np.ndenumerate(dataset.verdict.values):
        name = meanings_of(dataset.verdict)[verdict]
        colour = shown(pair[law], STEPS[k], heights[row])
        assert colour == to_hex(style.VERDICT_LOOKS[name]["color"]), (law, row, k)


def test_every_verdict_has_a_look_of_its_own():
    looks = {verdict.name.lower(): style.VERDICT_LOOKS[verdict.name.lower()] for verdict in Verdict}
    assert len({tuple(look.items()) for look in looks.values()}) == len(Verdict)


def test_zero_lies_below_all_numbers(data):
    heights = drawing._rows(data["damping"])
    assert heights[0] < heights[1:].min() - 1
    np.testing.assert_allclose(heights[1:], [0, 1, 3])


def test_theory_is_drawn_where_it_is(data, figure):
    lines = {line.get_label(): np.asarray(line.get_xydata()) for line in figure.axes[5].get_lines()}
    np.testing.assert_allclose(lines["contact"][:, 0], data["mass"].limit_steps.values[0, 1])
    np.testing.assert_allclose(lines["contact"][:, 1], [-2, 0, 6])
    ungated = [line.get_label() for line in figure.axes[0].get_lines()]
    assert {"contact", "drag"} <= set(ungated)


def test_the_legend_names_what_occurs_and_nothing_else(data, figure):
    (legend,) = figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    occurring = {Verdict(v) for dataset in data.values() for v in np.unique(dataset.verdict.values)}
    assert {text for text in texts if not text.startswith("theory")} == {verdict.sentence for verdict in occurring}
    assert not any("half a turn in a step" in text for text in texts)
