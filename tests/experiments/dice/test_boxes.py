"""The bodies that are thrown: a volume, a mass, moments of a solid box, a centre of mass where it is asked."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments.dice.axes import FACES, PAIRS, pairs_of
from stiffdice.experiments.dice.boxes import Throwing, box_of, faces_up
from stiffdice.scene.scene import from_mapping

SCENE = from_mapping(
    {
        "cube": {"side": "16 mm", "mass": "5 g"},
        "launch": {"position": [0, 0, 0.1], "velocity": [1, 0, 0]},
        "gravity": 9.81,
        "duration": 4,
    }
)
GROUND = (0.45, 0.2, 1e-3)
TOSSED = Throwing(velocity_spread=0.3, spin_spread=30.0, contact_time=1e-3, steps=20_000, throws=400)


def test_axes_are_those_of_the_pips():
    assert PAIRS == ("2-5", "3-4", "1-6")
    assert FACES == ((2, 5), (3, 4), (1, 6))
    np.testing.assert_array_equal(pairs_of(np.array([1, 20, 300, 400, 50, 6])), [70, 700, 7])


def test_a_box_keeps_volume_and_mass_and_is_solid():
    box = box_of(SCENE, *GROUND, stretch=(-0.1, 0.3, 0.1))
    sides = 2 * np.array(box.cube.half_sides)
    assert np.prod(sides) == pytest.approx(0.016**3, rel=1e-12)
    np.testing.assert_allclose(np.log(sides[1:] / sides[0]), [0.4, 0.2], rtol=1e-12)
    assert box.cube.mass == pytest.approx(0.005, rel=1e-12)
    a, b, c = sides**2 * 0.005 / 12
    np.testing.assert_allclose(box.cube.distribution.tensor, np.diag([b + c, c + a, a + b]), rtol=1e-12)
    assert (box.ground.friction, box.ground.contact, box.gravity) == (0.2, "gated", 9.81)


def test_the_centre_of_mass_is_off_by_the_offset_and_nothing_else_is():
    box = box_of(SCENE, *GROUND, offset=(0.05, -0.02, 0.1))
    np.testing.assert_allclose(box.cube.distribution.centre / 0.016, [0.05, -0.02, 0.1], rtol=1e-12)
    np.testing.assert_allclose(
        box.cube.distribution.tensor, box_of(SCENE, *GROUND).cube.distribution.tensor, rtol=1e-12
    )


def test_a_centre_of_mass_that_no_eight_masses_have_is_refused():
    with pytest.raises(InputError, match=r"offset = .*sizes sum to 0\.5 at most"):
        box_of(SCENE, *GROUND, offset=(0.2, 0.2, 0.2))


@pytest.mark.long
def test_throws_are_counted_and_are_the_same_again():
    counts, unsettled = faces_up(box_of(SCENE, *GROUND), TOSSED, seed=3)
    again, _ = faces_up(box_of(SCENE, *GROUND), TOSSED, seed=3)
    other, _ = faces_up(box_of(SCENE, *GROUND), TOSSED, seed=4)
    assert counts.sum() + unsettled == 400
    assert counts.min() > 30
    np.testing.assert_array_equal(counts, again)
    assert (counts != other).any()


@pytest.mark.long
def test_a_duration_in_which_nothing_settles_is_said():
    short = from_mapping({"launch": {"position": [0, 0, 3], "velocity": [1, 0, 0]}, "duration": 0.01})
    with pytest.raises(InputError, match=r"duration = 0.01: no throw settles"):
        faces_up(box_of(short, *GROUND), TOSSED, seed=0)


@pytest.mark.parametrize(("key", "value"), [("throws", 0), ("steps", 0), ("contact_time", 0.0), ("spin_spread", -1.0)])
def test_numbers_out_of_range_are_said(key, value):
    options = {"velocity_spread": 0.3, "spin_spread": 30.0, "contact_time": 1e-3, "steps": 100, "throws": 10}
    with pytest.raises(InputError, match=f"{key} = "):
        Throwing(**options | {key: value})
