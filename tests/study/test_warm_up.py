"""What a process that jobs are forked from loads beforehand: kernels that are stored, and no others."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

STUDY = """
question: Which kernels are stored?
runs:
  fall: {scene: config/scenes/figure-09.yaml, model: vertical, steps: 1000}
  slide: {scene: config/scenes/figure-09.yaml, model: sliding, steps: 1000}
"""
# Loads the kernels of that study and says how many signatures the loop of runs has then.
LOAD = """
import sys
from stiffdice.simulation import run
from stiffdice.study import config, warm_up
runs = list(warm_up.short_runs(config.load(sys.argv[1])))
print(len(runs), sum(map(warm_up.load, runs)), len(run._march.dispatcher.overloads))
"""
# Runs one of them, and copies the kernels that it takes to a folder.
RUN = """
import shutil, sys
from stiffdice.dynamics.compiling.kernel_files import KernelFiles
from stiffdice.scene import scene
from stiffdice.simulation.run import simulate

path, taken = KernelFiles.path, set()

def noted(self, key):
    taken.add(path(self, key))
    return path(self, key)

KernelFiles.path = noted
simulate(scene.load("config/scenes/figure-09.yaml"), model="vertical", steps=1, every=1)
for kernel in taken:
    shutil.copy(kernel, sys.argv[1])
"""


def python(text: str, *words: object, **environment: str) -> str:
    command = [sys.executable, "-c", text, *map(str, words)]
    done = subprocess.run(command, cwd=ROOT, env=os.environ | environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.long
def test_what_is_stored_is_loaded_and_nothing_is_compiled(tmp_path):
    study, cache = tmp_path / "which.yaml", {"NUMBA_CACHE_DIR": str(tmp_path)}
    study.write_text(STUDY)
    runs, *loaded = python(LOAD, study, **cache).split()
    assert int(runs) == 2
    assert loaded == ["0", "0"]
    assert not list(tmp_path.rglob("*.nbc"))
    (kernels,) = tmp_path.glob("stiffdice/kernels-*")
    python(RUN, kernels)
    stored = sorted(tmp_path.rglob("*.nbc"))
    assert stored
    assert python(LOAD, study, **cache).split() == [runs, "0", "1"]  # the kernels of the ledger are not there
    assert sorted(tmp_path.rglob("*.nbc")) == stored
