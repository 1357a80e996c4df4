"""How long things take: medians of interleaved rounds, and the machine they were taken on.

Times differ from one rebuild to the next, so they live apart from the data, as benchmarks do.
"""

from __future__ import annotations

import gc
import math
import os
import platform
import re
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from stiffdice.dynamics.state import Array

# A clock is read before and after so many seconds at least, that reading it takes no time of what it measures.
SHORTEST = 1e-3

_PACKAGES = ("stiffdice", "numpy", "numba", "scipy")


def interleaved(
    starts: Sequence[Callable[[], Callable[[], object]]], rounds: int, affordable: float
) -> tuple[Array, Array]:
    """Return each run's median time of a call [s], and half the range between the quartiles over it, shape (run,).

    starts: make a run ready, off the clock, and return what is timed. Runs take turns in each round, so that a slow
    moment of the machine hits all, and are warm: each has been called before. affordable [s]: one that takes longer is
    called once.
    """
    once = [seconds_of(start()) for start in starts]
    repeats = [math.ceil(SHORTEST / max(seconds, 1e-9)) for seconds in once]
    samples: list[list[float]] = [[] if seconds <= affordable else [seconds] for seconds in once]
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for k, start in enumerate(starts):
                if once[k] <= affordable:
                    samples[k].append(float(np.mean([seconds_of(start()) for _ in range(repeats[k])])))
    finally:
        gc.enable()
    quartiles = np.array([np.quantile(part, (0.25, 0.5, 0.75)) for part in samples]).reshape(-1, 3)
    return quartiles[:, 1], (quartiles[:, 2] - quartiles[:, 0]) / 2 / quartiles[:, 1]


def seconds_of(run: Callable[[], object], repeats: int = 1) -> float:
    """Return the wall time of a call [s], the mean of so many in a row."""
    begun = time.perf_counter()
    for _ in range(repeats):
        run()
    return (time.perf_counter() - begun) / repeats


def machine() -> dict[str, Any]:
    """Return the attributes that say where and with what times were taken."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        text = ""
    name = re.search(r"^model name\s*: *(.+?) *$", text, re.MULTILINE)
    packages = [f"{package} {version(package)}" for package in _PACKAGES]
    return {
        "machine_processor": name[1] if name else platform.machine(),
        "machine_cores": os.cpu_count() or 0,
        "machine_load_1_minute": round(os.getloadavg()[0], 2),
        "machine_system": platform.platform(),
        "versions": "; ".join([f"python {platform.python_version()}", *packages]),
        "measured_at": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }
