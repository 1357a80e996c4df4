from __future__ import annotations

import numpy as np
import pytest
from tests.advice.problems import flat, held

from stiffdice.advice.pilot import curve, flown


def test_the_error_is_the_root_mean_square_distance_in_radii():
    here = np.zeros((4, 3))
    there = np.array([[0, 0, 0], [3, 4, 0], [0, 0, 0], [0, 0, 5]])
    np.testing.assert_allclose(curve(here, there, 2.0), [0, 2.5 / 2**0.5, 2.5 / 3**0.5, 2.5 / 2**0.5])


@pytest.mark.long
def test_the_floor_is_at_least_what_two_methods_differ_by():
    pilot = flown(held())
    assert pilot.other.scheme == "lsoda"
    assert (pilot.floor >= pilot.error(pilot.other)).all()
    assert flown(flat()).other.scheme == "event"
