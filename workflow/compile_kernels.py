"""Compile the kernels that the jobs of some studies need, for all that come after: compile_kernels.py STUDY..."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "src")]

from stiffdice.study import config, warm_up  # noqa: E402

for name in sys.argv[1:]:
    study = config.load(ROOT / f"config/{name}.yaml")
    for run in warm_up.short_runs(study, ROOT):
        warm_up.compile_kernels(run)
