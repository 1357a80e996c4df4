"""What numba is made to do otherwise."""

from __future__ import annotations

import subprocess
import sys

import pytest

NAMES = """
from stiffdice.dynamics.compiling import compiler
from numba.core.bytecode import FunctionIdentity

def same():
    pass

print(FunctionIdentity.from_function(same).unique_name)
"""


@pytest.mark.long
def test_functions_of_one_name_have_other_symbols_in_each_process():
    """Kernels of several processes are loaded into one: where symbols are shared, calls reach the wrong function."""
    command = [sys.executable, "-c", NAMES]
    names = {subprocess.run(command, capture_output=True, text=True, check=True).stdout for _ in range(2)}
    assert len(names) == 2
