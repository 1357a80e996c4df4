"""What changed since the last bench, and what is only noise."""

from __future__ import annotations

import math
from typing import NamedTuple

import xarray as xr

from benchmarks.rows import samples_of, seconds_of, spread_of

# Of two benches of the same code on the same quiet machine medians differ by up to so much.
_FLOOR = 0.05

# So many spreads are noise: half the range between the quartiles is 0.67 standard deviations of a sample.
_SPREADS = 3.0

# Processes that ran, on average, in the minute before a bench of which no time is worth much.
_BUSY = 1.0

# What has to be the same for two benches to be compared without a warning, and how it is called.
SAME = {
    "machine_processor": "processor",
    "machine_cores": "cores",
    "machine_system": "system",
    "versions": "versions",
    "compiler": "compiler",
    "compiler_target": "the compiler's processor",
    "vector_width": "vector width",
}


class Change(NamedTuple):
    """How the time of a case changed: new over old [1], what of it may be noise [1], and in a word."""

    ratio: float
    noise: float
    verdict: str


def changes(new: xr.Dataset, old: xr.Dataset) -> dict[str, Change]:
    """Return the change of each case of a bench since an older one, by the case's name."""
    return {str(name): _change(new, old, str(name)) for name in new.data_vars}


def _change(new: xr.Dataset, old: xr.Dataset, name: str) -> Change:
    if name not in old:
        return Change(math.nan, math.nan, "new")
    if any(new[name].attrs.get(key) != old[name].attrs.get(key) for key in ("what", "per", "amount")):
        return Change(math.nan, math.nan, "measured otherwise")
    ratio = seconds_of(new, name) / seconds_of(old, name)
    spread = math.hypot(spread_of(samples_of(new, name)), spread_of(samples_of(old, name)))
    noise = max(_FLOOR, _SPREADS * spread)
    if not math.isfinite(ratio) or math.isnan(spread):
        return Change(ratio, math.nan, "too few samples")
    if max(ratio, 1 / ratio) <= 1 + noise:
        return Change(ratio, noise, "the same")
    return Change(ratio, noise, "slower" if ratio > 1 else "faster")


def differences(new: xr.Dataset, old: xr.Dataset) -> list[str]:
    """Return in a line each how the machines or versions of two benches differ, and whether one was busy."""
    found = [
        f"{told}: {new.attrs.get(key, 'unknown')}, before {old.attrs.get(key, 'unknown')}"
        for key, told in SAME.items()
        if str(new.attrs.get(key)) != str(old.attrs.get(key))
    ]
    loads = [float(part.attrs.get("machine_load_1_minute", 0.0)) for part in (new, old)]
    if max(loads) > _BUSY:
        found.append(f"load of a busy machine: {loads[0]:g}, before {loads[1]:g}")
    return found
