from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from tests.report.figures.drawing import check_equal_files, drawn

from stiffdice.experiments import engines
from stiffdice.experiments.work_precision import measure as work_precision
from stiffdice.experiments.work_precision.measure import STEPPING
from stiffdice.integrators.registry import SCHEMES
from stiffdice.io.cf_enums import enum_attributes, meanings_of
from stiffdice.report.figures import methods, style
from stiffdice.report.tables.methods import name_of
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
@pytest.mark.broad
def test_equal_data_give_equal_files(data, tmp_path, name):
    check_equal_files(name, {"flat": data["flat"]}, tmp_path)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.long
def test_axes_have_units_and_say_whether_work_or_time_is_shown(data, timings, name):
    for shown, unit in ((data, "force evaluations [1]"), (data | timings, "wall time [s]")):
        panels = drawn(name, shown).axes
        assert len(panels) == 2 * 3
        labels = [panels[-1].get_xlabel(), panels[0].get_ylabel()]
        assert all("[" in label for label in labels)
        assert unit in labels[name.startswith("cost")]
        assert {panel.get_xscale() for panel in panels} == {panel.get_yscale() for panel in panels} == {"log"}


@pytest.mark.long
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


@pytest.mark.long
def test_the_floor_is_drawn_and_within_the_axes(data):
    flat = data["flat"]
    for stiffness, panel in enumerate(drawn("work-precision", data).axes[:3]):
        low, high = flat.floor.isel(stiffness=stiffness, measure=0).values
        (band,) = panel.patches
        assert (band.get_y(), band.get_y() + band.get_height()) == (pytest.approx(low), pytest.approx(high))
        assert panel.get_ylim()[0] < low


@pytest.mark.long
def test_times_that_were_not_taken_are_hollow(data, timings):
    panel = drawn("work-precision", data | timings).axes[0]
    look = methods.look_of("symplectic_euler")
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
        (methods.look_of(name)["color"], methods.look_of(name)["marker"]) for name in [*SCHEMES, *SOLVERS, *STEPPING]
    }
    assert len(looks) == len(SCHEMES) + len(SOLVERS) + len(STEPPING)
    assert (style.QUIET, ".") not in looks


STIFF = from_mapping({"ground": {"stiffness": 1e6, "damping": 0.0}}, "as_written")
BESIDE = ["symplectic_euler", "scipy", "numpy"]


@pytest.fixture(scope="module")
def limits():
    return engines.limits(STIFF, methods=BESIDE, omega_h=[0.1, 12.0], count=4, phases=2)


@pytest.fixture(scope="module")
def speed():
    return engines.speed(STIFF, methods=BESIDE, steps=120, rounds=1)


@pytest.fixture(scope="module")
def throw():
    """Two methods, one of which blows up, beside a cube that falls and rises."""
    time = np.linspace(0, 4, 41)
    reference = np.zeros((41, 3))
    reference[:, 2] = 1 + np.abs(np.cos(2 * time))
    position = np.stack([np.stack([reference + 1e-3, reference + 1e-4])] * 2)
    position[1, 1, 20:] = np.nan
    grid = ("method", "effort")
    return xr.Dataset(
        {
            "position": ((*grid, "time", "axis"), position),
            "distance": ((*grid, "time"), np.linalg.norm(position - reference, axis=-1)),
            "reference_position": (("time", "axis"), reference),
            "reference_error": ("time", np.full(41, 1e-9)),
            "evaluations": (grid, [[100, 1000], [100, 1000]]),
            "steps": (grid, [[100, 1000], [0, 0]]),
            "tolerance": (grid, [[np.nan, np.nan], [1e-4, 1e-8]]),
        },
        {"method": ("method", np.arange(2, dtype=np.int8), enum_attributes("method", BESIDE[:2])), "time": time},
        {"reference": "event", "engine_versions": "scipy 1.17.1", "unfit": "drake: no reason"},
    )


def texts(figure):
    told = [*figure.texts, *(legend.get_title() for legend in figure.legends)]
    return " ".join(part.get_text().replace("\n", " ") for part in told)


@pytest.mark.long
def test_axes_of_engines_have_units(limits, speed, throw):
    for name, data in {"engine-limits": limits, "engine-speed": speed, "engine-throw": throw}.items():
        for panel in drawn(name, {"name": data}).axes:
            labels = panel.get_xlabel() + panel.get_ylabel()
            assert not labels or "[" in labels


@pytest.mark.long
def test_notes_tell_versions_and_what_is_missing(limits, speed):
    for name, data in {"engine-limits": limits, "engine-speed": speed}.items():
        told = texts(drawn(name, {"name": data}))
        assert f"numpy {np.__version__}" in told
        assert "MuJoCo, PyBullet, Drake, DART, GNU Octave" in told


def test_each_method_has_a_panel_with_the_limit_of_stability(limits):
    panels = drawn("engine-limits", {"name": limits}).axes
    assert [panel.get_title(loc="left") for panel in panels] == [name_of(name) for name in BESIDE]
    for panel in panels:
        assert any(np.allclose(line.get_xdata(), 2.0) for line in panel.get_lines())


def test_a_bounce_that_gains_much_is_told_in_words(limits):
    panels = drawn("engine-limits", {"name": limits}).axes
    told = [" ".join(part.get_text() for part in panel.texts) for panel in panels]
    assert "to e =" in told[0]
    assert not told[1]


def test_bars_are_as_long_as_the_rates(speed):
    (panel,) = drawn("engine-speed", {"name": speed}).axes
    lengths = sorted(bar.get_width() for bar in panel.patches)
    assert lengths == pytest.approx(np.sort((speed.taken / speed.seconds).values.ravel()))


def test_the_throw_is_told_as_far_as_it_goes(throw):
    figure = drawn("engine-throw", {"name": throw})
    left, middle, right = figure.axes
    assert len(left.get_lines()) == len(BESIDE[:2]) + 1
    assert np.isnan(middle.get_lines()[1].get_ydata()[-1])
    assert len(right.get_lines()) == 2
    told = texts(figure)
    assert "symplectic euler 1000 steps, SciPy LSODA tolerance 10⁻⁸" in told
    assert "drake: no reason" in told
