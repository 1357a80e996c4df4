"""Probabilities of faces: what symmetry asks of them, and what a study stores."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments.dice import landing
from stiffdice.io.writer import write_dataset
from stiffdice.scene import die
from stiffdice.scene.scene import from_mapping

FAIR = from_mapping(die.SCENE)


@pytest.fixture(scope="module")
def long_box():
    scene = from_mapping({**die.SCENE, "cube": {"sides": "[16, 16, 22] mm", "mass": "5 g"}})
    return landing.measure(scene, throws=3000)


@pytest.mark.long
def test_faces_that_symmetry_makes_equal_are(long_box):
    """The ends 1 and 6 against each other, the four sides, too; the ends are rarer."""
    p, n = long_box.probability.values, float(long_box["count"].sum())
    for same in ([0, 5], [1, 2, 3, 4]):
        spread = np.abs(p[same] - p[same].mean()).max()
        assert spread < 4 * np.sqrt(p[same].mean() / n)
    assert p[[0, 5]].max() < p[1:5].min()


def test_what_is_stored_says_what_was_done(long_box, tmp_path):
    write_dataset(long_box, tmp_path / "landing.h5")
    assert long_box.attrs["throws"] == int(long_box.rest_count.sum()) == 3000
    assert (long_box.probability_low < long_box.probability).all()
    assert (long_box.time_to_decision.diff("quantile") > 0).all()
    assert all("units" in variable.attrs for name, variable in long_box.variables.items() if name != "rest")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"spin": "paper"}, "spin = paper: allowed is gaussian or scene"),
        ({"throws": 0}, "throws = 0"),
        ({"orientation": "flat"}, "orientation = flat"),
        ({"steps": 0}, "steps = 0"),
        ({"velocity_spread": -1.0}, "velocity_spread = -1"),
    ],
)
def test_options_out_of_range_are_told(options, told):
    with pytest.raises(InputError, match=told):
        landing.measure(FAIR, **options)
