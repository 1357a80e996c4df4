from __future__ import annotations

import numpy as np
from scipy.integrate import DOP853

from stiffdice import dormand_prince


def test_coefficients_are_those_of_dop853():
    stages = dormand_prince.STAGES
    np.testing.assert_array_equal(dormand_prince.COUPLING, DOP853.A[:stages, :stages])
    np.testing.assert_array_equal(dormand_prince.WEIGHTS, DOP853.B)
    np.testing.assert_array_equal(dormand_prince.ERROR_5, DOP853.E5[:stages])
    np.testing.assert_array_equal(dormand_prince.ERROR_3, DOP853.E3[:stages])
