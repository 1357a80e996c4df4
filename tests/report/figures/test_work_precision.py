from __future__ import annotations

import numpy as np
import pytest
from tests.report.figures.drawing import check_equal_files, drawn

from stiffdice.experiments.work_precision import measure as work_precision
from stiffdice.experiments.work_precision.measure import STEPPING
from stiffdice.integrators.registry import SCHEMES
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import method_style, style
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.engines.registry import PEERS, SOLVERS

SCENE = from_mapping({"ground": {"damping": 0.1, "friction": 0.1}, "duration": 3.0}, "as_written")
METHODS = ["symplectic_euler", *SOLVERS]
NAMES = ["work-precision", "work-restitution", "work-energy", "cost", "cost-restitution", "cost-energy"]


@pytest.fixture(scope="module")
def data():
    options = {"methods": METHODS, "stiffness": [1e2, 1e4, 1e6], "per_decade": 1}
    flat, rubbing = (
        work_precision.measure(SCENE, problem=problem, steps=1e5, **options)
        for problem in ("flat-bounce", "sliding-bounce")
    )
    return {"flat": flat, "rubbing": rubbing}


@pytest.fixture(scope="module")
def timings():
    options = {"methods": METHODS, "stiffness": [1e2, 1e4, 1e6], "per_decade": 1, "affordable": 1e-3, "rounds": 1}
    problems = {"flat timed": "flat-bounce", "rubbing timed": "sliding-bounce"}
    return {name: work_precision.time(SCENE, problem=problem, **options) for name, problem in problems.items()}


def lines_of(panel):
    return {line.get_label(): line for line in panel.get_lines()}


@pytest.mark.parametrize("name", ["work-energy", "cost"])
def test_equal_data_give_equal_files(data, tmp_path, name):
    check_equal_files(name, {"flat": data["flat"]}, tmp_path)


@pytest.mark.parametrize("name", NAMES)
def test_axes_have_units_and_say_whether_work_or_time_is_shown(data, timings, name):
    for shown, unit in ((data, "force evaluations [1]"), (data | timings, "wall time [s]")):
        panels = drawn(name, shown).axes
        assert len(panels) == 2 * 3
        labels = [panels[-1].get_xlabel(), panels[0].get_ylabel()]
        assert all("[" in label for label in labels)
        assert unit in labels[name.startswith("cost")]
        assert {panel.get_xscale() for panel in panels} == {panel.get_yscale() for panel in panels} == {"log"}


def test_errors_are_drawn_against_work_one_line_for_each_method(data):
    flat = data["flat"]
    names = meanings_of(flat.method)
    for stiffness, panel in enumerate(drawn("work-precision", data).axes[:3]):
        lines = lines_of(panel)
        for k, method in enumerate(names):
            rungs = flat.isel(stiffness=stiffness, method=k)
            rungs = rungs.isel(effort=rungs.evaluations.values > 0)
            wanted = np.stack([rungs.evaluations, np.minimum(rungs.position_error, 10)], axis=1)
            np.testing.assert_array_equal(lines[method].get_xydata(), wanted)
            assert lines[method].get_linestyle() == ("--" if method in PEERS else "-")


def test_the_floor_is_drawn_and_within_the_axes(data):
    flat = data["flat"]
    for stiffness, panel in enumerate(drawn("work-precision", data).axes[:3]):
        low, high = flat.floor.isel(stiffness=stiffness, measure=0).values
        (band,) = panel.patches
        assert (band.get_y(), band.get_y() + band.get_height()) == (pytest.approx(low), pytest.approx(high))
        assert panel.get_ylim()[0] < low


def test_times_that_were_not_taken_are_hollow(data, timings):
    panel = drawn("work-precision", data | timings).axes[0]
    look = method_style.look("symplectic_euler")
    marks = [
        line
        for line in panel.get_lines()
        if line.get_marker() == look["marker"] and line.get_color() == look["color"] and len(line.get_xydata())
    ]
    full, hollow = sorted(marks, key=lambda line: line.get_markerfacecolor() == "none")
    assert hollow.get_markerfacecolor() == "none"
    assert 1 <= len(full.get_xydata()) <= 3


def test_the_cost_is_drawn_with_the_papers_law_beside(data):
    for panel in drawn("cost", data).axes:
        lines = lines_of(panel)
        costs = lines["symplectic_euler"].get_ydata()
        laws = [line for line in panel.get_lines() if line.get_linestyle() == ":"]
        known = np.isfinite(costs)
        assert len(laws) == known.any()
        for law in laws:
            x, y = law.get_data()
            assert y[known][0] == pytest.approx(costs[known][0])
            np.testing.assert_allclose(np.diff(np.log(y)) / np.diff(np.log(x)), 0.5)


def test_every_method_has_a_look_of_its_own():
    looks = {
        (method_style.look(name)["color"], method_style.look(name)["marker"])
        for name in [*SCHEMES, *SOLVERS, *STEPPING]
    }
    assert len(looks) == len(SCHEMES) + len(SOLVERS) + len(STEPPING)
    assert (style.QUIET, ".") not in looks
