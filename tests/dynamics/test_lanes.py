"""Numbers of several members side by side."""

from __future__ import annotations

import os
import subprocess
import sys

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
def test_the_first_kernel_of_a_process_may_have_them(tmp_path):
    script = tmp_path / "own.py"
    script.write_text(OWN)
    places = {"NUMBA_CACHE_DIR": str(tmp_path / "kernels"), "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, script], env=os.environ | places, capture_output=True, text=True, check=False
    )
    assert done.stdout == "[[1.0, 2.0, 3.0, 0.0]]\n", done.stderr
