from __future__ import annotations

import os
import subprocess
import sys

import pytest


@pytest.fixture
def run_script(tmp_path):
    """Return what a script did in a process and a cache of kernels of its own; a stored kernel wants a file."""

    def run(code: str, *words: str) -> subprocess.CompletedProcess[str]:
        script = tmp_path / "own.py"
        script.write_text(code)
        places = {"NUMBA_CACHE_DIR": str(tmp_path / "kernels"), "PYTHONPATH": os.pathsep.join(sys.path)}
        command = [sys.executable, str(script), *words]
        return subprocess.run(command, env=os.environ | places, capture_output=True, text=True, check=False)

    return run
