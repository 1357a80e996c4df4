from __future__ import annotations

import numpy as np
import pytest

from stiffdice import theory
from stiffdice.scene import Scene


def test_the_papers_steps_in_units_of_the_contact_frequency():
    stiff = Scene().with_ground(stiffness=1e6)
    assert theory.omega_h(stiff, 10_000) == 2.0
    assert theory.omega_h(stiff, 20_000) == 1.0
    assert theory.steps_for(stiff, 2.0) == 10_000


@pytest.mark.parametrize(("stiffness", "mass"), [(1e300, 1e-9), (1e-300, 1e9), (0.0, 1.0)])
def test_the_frequency_stays_in_range_where_the_quotient_does_not(stiffness, mass):
    assert np.isfinite(theory.contact_frequency(stiffness, mass))
