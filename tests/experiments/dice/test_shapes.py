"""Square boxes: a coin lands flat, a cube is fair, a rod lies down; beside what is stored of others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments.dice import shapes
from stiffdice.scene import scene as scenes

SCENE = scenes.load(Path(__file__).parents[3] / "config/scenes/thrown-die.yaml")
ONE = {"restitution": [0.45], "friction": [0.2]}


@pytest.mark.long
def test_ends_come_up_less_the_longer_the_box():
    found = shapes.measure(SCENE, aspect=[0.4, 1.0, 2.0], throws=3000, **ONE)
    coin, cube, rod = found.end_pair.values[:, 0, 0]
    assert coin > 0.9
    assert rod < 0.05
    assert cube == pytest.approx(1 / 3, abs=4 * float(found.end_pair_error[1, 0, 0]))
    assert (found.unsettled < 0.01).all()
    assert found.end_pair.dims == ("aspect", "restitution", "friction")


@pytest.mark.long
def test_what_was_measured_is_stored_with_its_slope():
    aspect, throws = np.array([0.7, 0.9, 1.1, 1.4, 2.0]), np.full(5, 1_000_000)
    x = np.log(aspect)
    odds = np.exp(1.5 * -3.2 * x - 1.1 * x * x) / 2
    given = {"measured_aspect": list(aspect), "measured_part": list(odds / (1 + odds)), "measured_throws": list(throws)}
    found = shapes.measure(SCENE, aspect=[0.8, 1.25], throws=100, **ONE, **given)
    assert float(found.measured_chi) == pytest.approx(-3.2, abs=1e-6)
    assert 0 < float(found.measured_chi_error) < 0.02
    np.testing.assert_allclose(found.measured_part, odds / (1 + odds), rtol=1e-15)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"aspect": [0.0]}, "aspect = 0"),
        ({"restitution": [1.5]}, "restitution = 1.5"),
        ({"throws": 0}, "throws = 0"),
        ({"measured_aspect": [1.0]}, "allowed are lists of one length"),
    ],
)
def test_numbers_out_of_range_are_said(options, told):
    with pytest.raises(InputError, match=told):
        shapes.measure(SCENE, **{"aspect": [1.0], "throws": 1, **ONE, **options})
