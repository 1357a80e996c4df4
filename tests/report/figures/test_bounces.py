from __future__ import annotations

import numpy as np
import pytest
from tests.report.figures.drawing import check_equal_files, check_units, drawn, lines_of

from stiffdice.dynamics import linear_theory
from stiffdice.experiments import bounce_map
from stiffdice.experiments.energy_budget import measure
from stiffdice.report.figures import style
from stiffdice.scene.scene import Scene, from_mapping


@pytest.fixture(scope="module")
def bounces():
    scene = from_mapping({"ground": {"stiffness": 1e6}})
    return {"bounces": bounce_map.measure(scene, omega_h=(0.1, 1.9), count=30, phases=40)}


def test_axes_have_units(bounces):
    check_units(drawn("bounce-map", bounces))


@pytest.mark.broad
def test_equal_data_give_equal_files(bounces, tmp_path):
    check_equal_files("bounce-map", bounces, tmp_path)


def test_the_bounce_map_is_drawn_where_it_is(bounces):
    (found,) = bounces.values()
    figure = drawn("bounce-map", bounces)
    upper, lower, bar = figure.axes
    (mesh,) = upper.collections
    np.testing.assert_array_equal(mesh.get_array()[:-1], found.energy_gain.values.T)
    np.testing.assert_array_equal(mesh.get_array()[-1], found.energy_gain.values[:, 0])
    places = mesh.get_coordinates()
    middle = np.sqrt(places[0, 1:-2, 0] * places[0, 2:-1, 0])
    ratio = found.omega_h.values[2:] * found.omega_h.values[:-2]
    np.testing.assert_allclose(middle**4, ratio * found.omega_h.values[1:-1] ** 2)
    np.testing.assert_allclose(places[:, 0, 1], (np.arange(42) - 0.5) / 40)
    # A phase is never hidden, nor its colour out of scale, and no gain looks like a loss.
    assert upper.get_ylim() == (0, 1)
    assert upper.get_xlim() == (0.1, 1.9)
    assert mesh.norm.vmin == -mesh.norm.vmax < found.energy_gain.min()
    assert mesh.norm.vmax > found.energy_gain.max()
    assert mesh.norm(0.0) == pytest.approx(0.5)
    assert "linear below" in bar.get_ylabel()
    (top,) = upper.child_axes
    magic = [2 * np.sin(np.pi / (2 * n)) for n in range(2, 32)]
    np.testing.assert_allclose(top.get_xticks(), magic[: len(top.get_xticks())])
    assert [label.get_text() for label in top.get_xticklabels()][:9] == [*"23456789", ""]
    assert lower.get_xlim() == upper.get_xlim()


def test_the_extremes_of_a_bounce_are_drawn_over_theory(bounces):
    (found,) = bounces.values()
    lower = drawn("bounce-map", bounces).axes[1]
    lines = lines_of(lower)
    np.testing.assert_array_equal(
        lines["largest gain"], np.stack([found.omega_h, np.abs(found.energy_gain.max("phase"))], axis=1)
    )
    np.testing.assert_array_equal(
        lines["largest loss"], np.stack([found.omega_h, np.abs(found.energy_gain.min("phase"))], axis=1)
    )
    for label, curve in {
        "bound of a gain: 1/(1 − ¼(ωh)²) − 1": lambda x: 1 / (1 - x**2 / 4) - 1,
        "bound of a loss: ¼(ωh)²": lambda x: x**2 / 4,
        "theory: 2gh/v": lambda x: 2 * 9.8 * x / 2000 / float(found.speed),
        "largest gain by theory": lambda x: np.array([linear_theory.largest_gain(value) - 1 for value in x]),
        "largest loss by theory": lambda x: np.array([1 - 1 / linear_theory.largest_gain(value) for value in x]),
    }.items():
        np.testing.assert_allclose(lines[label][:, 1], curve(lines[label][:, 0]), rtol=1e-9, atol=1e-14)
        assert (lines[label][0, 0], lines[label][-1, 0]) == pytest.approx((0.1, 1.9))
    weighed = lines["at a magic step with gravity"]
    assert len(weighed) == 30
    wanted = found.largest_with_gravity.sel(omega_h=weighed[:, 0])
    np.testing.assert_array_equal(weighed[:, 1], wanted)
    np.testing.assert_allclose(weighed[:, 0], sorted(2 * np.sin(np.pi / (2 * np.arange(2, 32)))))
    low, high = lower.get_ylim()
    shown = np.concatenate([line[:, 1] for line in lines.values()])
    assert high > shown.max()
    assert (shown[shown > 1e-14] > low).all()


def test_every_bounce_is_drawn_where_it_is():
    books = measure(Scene().with_ground(stiffness=1e6), steps=[20_000, 23_000], bounces=3)
    figure = drawn("energy-budget", {"books": books})
    assert "[J]" in figure.axes[0].get_ylabel()
    assert "[1]" in figure.axes[-1].get_xlabel()
    for k, axes in enumerate(figure.axes):
        works = {
            style.QUIET: books.friction_work.values[k],
            style.BLUE: (books.damping_work + books.drag_work).values[k],
            style.VERMILION: books.scheme_work.values[k],
        }
        for color, values in works.items():
            marks = [line for line in axes.get_lines() if line.get_color() == color and line.get_marker() in ("^", "v")]
            shown = {line.get_marker(): np.sort(line.get_ydata()) for line in marks}
            np.testing.assert_array_equal(shown["^"], np.sort(values[values > 0]))
            np.testing.assert_array_equal(shown["v"], np.sort(-values[values < 0]))
