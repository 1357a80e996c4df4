from __future__ import annotations

import numpy as np
import pytest
from tests.report.figures.drawing import drawn

from stiffdice.dynamics import linear_theory
from stiffdice.experiments import friction_chatter, rocking
from stiffdice.io.cf_enums import meanings_of
from stiffdice.scene.scene import Scene


@pytest.fixture(scope="module")
def dataset():
    return rocking.measure(Scene(), zeta=(0.0, 0.3, 1.0), omega_h_relative=(0.9, 0.97, 1.03, 1.1))


@pytest.fixture(scope="module")
def panels(dataset):
    return drawn("rocking", {"rocking": dataset}).axes


def lines_of(panel):
    marks, plain = {}, []
    for line in panel.get_lines():
        points = np.asarray(line.get_xydata())
        if line.get_marker() == "None":
            plain.append(points)
        else:
            marks.setdefault(line.get_label(), []).append(points)
    return marks, plain


def test_axes_have_units(panels):
    assert len(panels) == 3
    for panel in panels:
        assert "[" in panel.get_xlabel()
        assert "[" in panel.get_ylabel()


def test_limits_are_drawn_for_every_mode_and_inertia_over_theory(panels, dataset):
    marks, plain = lines_of(panels[0])
    wanted = {
        f"{mode} {inertia}": np.stack([dataset.zeta, dataset.limit[i, k]], axis=1)
        for i, inertia in enumerate(meanings_of(dataset.inertia))
        for k, mode in enumerate(meanings_of(dataset.mode))
    }
    assert set(marks) == set(wanted)
    for label, (points,) in marks.items():
        np.testing.assert_array_equal(points, wanted[label])
    (curve,) = plain
    np.testing.assert_allclose(curve[:, 1], 2 * (np.sqrt(1 + curve[:, 0] ** 2) - curve[:, 0]), rtol=1e-14)
    assert (curve[0, 0], curve[-1, 0]) == (0, 1)


def test_marks_on_one_point_all_show(panels):
    """Outlines of falling size over pale marks of the same sizes."""
    lines = [line for line in panels[0].get_lines() if line.get_marker() != "None"]
    outlines = [line for line in lines if line.get_label().endswith("solid")]
    assert all(line.get_markerfacecolor() == "none" for line in outlines)
    sizes = [line.get_markersize() for line in outlines]
    assert sizes == sorted(sizes, reverse=True)
    assert len(set(sizes)) == 4
    for pale in set(lines) - set(outlines):
        assert pale.get_alpha() < 0.5
        assert pale.get_zorder() < outlines[0].get_zorder()


def test_the_longest_steps_are_drawn_and_the_shortest_of_them_named(panels, dataset):
    marks, plain = lines_of(panels[1])
    for i, inertia in enumerate(meanings_of(dataset.inertia)):
        for k, mode in enumerate(meanings_of(dataset.mode)):
            ((point,),) = marks[f"{mode} {inertia}"]
            np.testing.assert_array_equal(point, [k, dataset.longest_step[i, k, 0]])
    dashes = sorted(points[0, 1] for points in plain if points[0, 0] != 0 or points[-1, 0] != 1)
    np.testing.assert_allclose(dashes, sorted(2 / np.sqrt([4, 6, 5, 4, 4, 2, 3, 2])))
    lowest = sorted(points[0, 1] for points in plain if points[0, 0] == 0 and points[-1, 0] == 1)
    np.testing.assert_allclose(lowest, [2 / np.sqrt(6), 1], rtol=1e-6)
    texts = [text.get_text().replace("\n", " ") for text in panels[1].texts]
    assert "solid: limited by face rocking, 0.816" in texts
    assert "corners: limited by face bounce, 1.000" in texts
    assert sorted(text for text in texts if text.startswith("k")) == [f"k = {k}" for k in (2, 2, 3, 4, 4, 5, 6)]


def test_growth_is_drawn_over_theory(panels, dataset):
    marks, curves = lines_of(panels[2])
    for i, inertia in enumerate(meanings_of(dataset.inertia)):
        for k, mode in enumerate(("face_bounce", "face_rocking")):
            for z, points in enumerate(marks[f"{mode} {inertia}"]):
                np.testing.assert_array_equal(
                    points, np.stack([dataset.omega_h_relative, dataset.growth[i, k, z]], axis=1)
                )
    for curve, zeta in zip(curves, (0.0, 0.2), strict=True):
        wanted = [linear_theory.growth(part * linear_theory.stability_limit(zeta), zeta) for part in curve[:, 0]]
        np.testing.assert_allclose(curve[:, 1], wanted)


def test_chatter_is_drawn_over_theory():
    dataset = friction_chatter.measure(Scene(), friction=(0.075,), step_size=(1e-6, 1e-5, 1e-4))
    (panel,) = drawn("friction-chatter", {"chatter": dataset}).axes
    assert "[s]" in panel.get_xlabel()
    assert "[m/s]" in panel.get_ylabel()
    swings, rests, curve = (np.asarray(line.get_xydata()) for line in panel.get_lines()[:3])
    np.testing.assert_allclose(swings, np.stack([[1e-5, 1e-4], dataset.swing.values[0, 1:]], axis=1))
    assert rests[:, 0] == [1e-6]
    np.testing.assert_allclose(curve[:, 1], 0.075 * 9.8 * curve[:, 0] / 2 - 1e-6, atol=1e-12)
