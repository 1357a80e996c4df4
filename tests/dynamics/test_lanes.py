"""Numbers of several members side by side."""

from __future__ import annotations

import pytest

OWN = """
import numpy as np
from stiffdice.dynamics.compilation import load, njit, store

@njit(cache=True)
def absolute(numbers):
    positive = abs(load(numbers, 0, 4))
    store(numbers, 0, positive)

numbers = np.array([[-1.0, 2.0, -3.0, 0.0]])
absolute(numbers)
print(numbers.tolist())
"""


@pytest.mark.long
def test_the_first_kernel_of_a_process_may_have_them(run_script):
    done = run_script(OWN)
    assert done.stdout == "[[1.0, 2.0, 3.0, 0.0]]\n", done.stderr
