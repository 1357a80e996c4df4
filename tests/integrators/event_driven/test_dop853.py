from __future__ import annotations

import numpy as np
from scipy.integrate import DOP853

from stiffdice.integrators.event_driven import dop853


def test_coefficients_are_those_of_dop853():
    stages = dop853.STAGES
    np.testing.assert_array_equal(dop853.COUPLING, DOP853.A[:stages, :stages])
    np.testing.assert_array_equal(dop853.WEIGHTS, DOP853.B)
    np.testing.assert_array_equal(dop853.ERROR_5, DOP853.E5[:stages])
    np.testing.assert_array_equal(dop853.ERROR_3, DOP853.E3[:stages])
