"""What a bench tells of each case: median, spread, cycles, and how far it is from what limits it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import Array


class Row(NamedTuple):
    """One case, told.

    seconds: median wall time of one `per` [s]. spread: half the range between the quartiles over the median [1], NaN of
    fewer than three samples. cycles: of the processor in that time, bound: those it takes at least, and by what; NaN
    where nothing is known. share: of the floating-point peak [1], NaN where nobody counted operations.
    """

    name: str
    what: str
    per: str
    unit: str
    seconds: float
    spread: float
    samples: int
    cycles: float
    bound: float
    bound_by: str
    share: float
    limited_by: str
    version: str


def samples_of(bench: xr.Dataset, name: str) -> Array:
    """Return the wall times of a case in each round [s], shape (round,), NaN where it had no turn."""
    return np.asarray(bench[name].values, float)


def seconds_of(bench: xr.Dataset, name: str) -> float:
    """Return the median wall time of a case [s]; NaN if it is not in the bench."""
    return float(np.nanmedian(samples_of(bench, name))) if name in bench else math.nan


def best_of(bench: xr.Dataset, name: str) -> float:
    """Return the least wall time of a case [s], as befits a limit; NaN if it is not in the bench."""
    return float(np.nanmin(samples_of(bench, name))) if name in bench else math.nan


def spread_of(values: Array) -> float:
    """Return half the range between the quartiles over the median [1]; NaN of fewer than three values."""
    known = values[np.isfinite(values)]
    if len(known) < 3:
        return math.nan
    low, middle, high = np.quantile(known, (0.25, 0.5, 0.75))
    return float((high - low) / 2 / middle)


def rows_of(bench: xr.Dataset) -> list[Row]:
    """Return a row for each case, in the order of the file."""
    return [_row(bench, str(name)) for name in bench.data_vars]


def _row(bench: xr.Dataset, name: str) -> Row:
    attributes = bench[name].attrs
    seconds, values = seconds_of(bench, name), samples_of(bench, name)
    cycle, peak = best_of(bench, "cycle"), best_of(bench, "fma_peak")
    chain = str(attributes.get("chain", "")).split()
    flops = float(attributes.get("floating_point_operations", 0))
    waiting = sum(best_of(bench, f"latency_{link}") for link in chain) if chain else math.nan
    working = flops * peak if flops else math.nan
    bound, by = (waiting, "waiting") if chain else (working, "peak")
    return Row(
        name,
        str(attributes["what"]),
        str(attributes["per"]),
        str(attributes["units"]),
        seconds,
        spread_of(values),
        int(np.isfinite(values).sum()),
        seconds / cycle,
        bound / cycle,
        by if math.isfinite(bound) else "",
        working / seconds,
        str(attributes["limited_by"]),
        str(attributes.get("version", "")),
    )
