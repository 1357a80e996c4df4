from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from stiffdice.experiments import engines
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.report.figures import style
from stiffdice.report.figures.engines import limits as limits_drawing
from stiffdice.report.figures.engines import speed as speed_drawing
from stiffdice.report.figures.engines import throw as throw_drawing
from stiffdice.report.methods import name_of
from stiffdice.scene.scene import from_mapping

SCENE = from_mapping({"ground": {"stiffness": 1e6, "damping": 0.0}}, "as_written")
METHODS = ["symplectic_euler", "scipy", "numpy"]


@pytest.fixture(scope="module")
def limits():
    return engines.limits(SCENE, methods=METHODS, omega_h=[0.1, 12.0], count=4, phases=2)


@pytest.fixture(scope="module")
def speed():
    return engines.speed(SCENE, methods=METHODS, steps=120, rounds=1)


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
        {"method": ("method", np.arange(2, dtype=np.int8), enum_attributes("method", METHODS[:2])), "time": time},
        {"reference": "event", "engine_versions": "scipy 1.17.1", "unfit": "drake: no reason"},
    )


def drawn(drawing, data):
    with style.applied():
        figure = drawing.draw({"name": data}, "A title")
        figure.canvas.draw()
    return figure


def texts(figure):
    return " ".join(part.get_text().replace("\n", " ") for part in figure.texts)


def test_axes_have_units(limits, speed, throw):
    for drawing, data in ((limits_drawing, limits), (speed_drawing, speed), (throw_drawing, throw)):
        for panel in drawn(drawing, data).axes:
            labels = panel.get_xlabel() + panel.get_ylabel()
            assert not labels or "[" in labels


def test_notes_tell_versions_and_what_is_missing(limits, speed):
    for drawing, data in ((limits_drawing, limits), (speed_drawing, speed)):
        told = texts(drawn(drawing, data))
        assert f"numpy {np.__version__}" in told
        assert "MuJoCo, PyBullet, Drake, GNU Octave" in told


def test_each_method_has_a_panel_with_the_limit_of_stability(limits):
    panels = drawn(limits_drawing, limits).axes
    assert [panel.get_title(loc="left") for panel in panels] == [name_of(name) for name in METHODS]
    for panel in panels:
        assert any(np.allclose(line.get_xdata(), 2.0) for line in panel.get_lines())


def test_a_bounce_that_gains_much_is_told_in_words(limits):
    panels = drawn(limits_drawing, limits).axes
    told = [" ".join(part.get_text() for part in panel.texts) for panel in panels]
    assert "to e =" in told[0]
    assert not told[1]


def test_bars_are_as_long_as_the_rates(speed):
    (panel,) = drawn(speed_drawing, speed).axes
    lengths = sorted(bar.get_width() for bar in panel.patches)
    assert lengths == pytest.approx(np.sort((speed.taken / speed.seconds).values.ravel()))


def test_the_throw_is_told_as_far_as_it_goes(throw):
    figure = drawn(throw_drawing, throw)
    left, middle, right = figure.axes
    assert len(left.get_lines()) == len(METHODS[:2]) + 1
    assert np.isnan(middle.get_lines()[1].get_ydata()[-1])
    assert len(right.get_lines()) == 2
    told = texts(figure)
    assert "symplectic euler 1000 steps, SciPy LSODA tolerance 10⁻⁸" in told
    assert "drake: no reason" in told
