"""What was aimed at, and what is reached: ratios of cases of one bench, taken round by round, and times."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from benchmarks.rows import best_of, samples_of, spread_of
from stiffdice.dynamics.state import Array


class Aim(NamedTuple):
    """One aim: that `over` takes so many times as long as `under`.

    at_least: the ratio [1] aimed at; 0 if it is only told. share: the ratio of what the operations of `under` would
    take at the peak `over` to what it takes.
    """

    what: str
    over: str
    under: str
    at_least: float = 0.0
    share: bool = False


class Limit(NamedTuple):
    """One aim: that a case takes at most so long [s]; with `beyond`, longer than that other case.

    shared: among how many, an attribute of the bench, what it takes longer is.
    """

    what: str
    case: str
    at_most: float = math.inf
    beyond: str = ""
    shared: str = ""


class Reached(NamedTuple):
    """What became of an aim: the value, a ratio [1] or a time [s], its spread [1], and whether it is reached.

    NaN where it was not measured; met is None there, and where nothing was aimed at.
    """

    what: str
    unit: str
    aimed: str
    value: float
    spread: float
    met: bool | None


RATIOS = (
    Aim(
        "throw, ungated: Octave node by node over the loop of sweeps",
        "octave_listing",
        "ensemble_tumbling_ungated",
        1e5,
    ),
    Aim(
        "throw, gated: MuJoCo's rollout over the loop of sweeps",
        "mujoco_rollout_tumbling_gated",
        "ensemble_tumbling_gated",
        250,
    ),
    Aim(
        "vertical, gated: MuJoCo's rollout over the loop of sweeps",
        "mujoco_rollout_vertical_gated",
        "ensemble_vertical_gated",
        2000,
    ),
    Aim("throw, gated: listings' order over the loop of sweeps", "listing_tumbling_gated", "ensemble_tumbling_gated"),
    Aim(
        "throw, ungated: listings' order over the loop of sweeps",
        "listing_tumbling_ungated",
        "ensemble_tumbling_ungated",
    ),
    Aim("sliding, ungated: share of the FMA peak", "fma_peak", "ensemble_sliding_ungated", share=True),
    Aim("tumbling, ungated: share of the FMA peak", "fma_peak", "ensemble_tumbling_ungated", share=True),
    Aim("tumbling, gated: share of the FMA peak", "fma_peak", "ensemble_tumbling_gated", share=True),
    Aim("fair die until decided: MuJoCo's rollout over ours", "mujoco_rollout_landing", "landing_fair", 100),
    Aim("gated sweep at S = 10⁸, vertical: stepped over skipping", "sweep_vertical_stepped", "sweep_vertical", 100),
    Aim("gated sweep at S = 10⁸, tumbling: stepped over skipping", "sweep_tumbling_stepped", "sweep_tumbling", 20),
)

TIMES = (
    Limit("stiffdice --help", "help", 0.3),
    Limit("compilation in a first run, sliding", "first_run_sliding", 15, beyond="later_run"),
    Limit("compilation in a first run, tumbling", "first_run_tumbling", 15, beyond="later_run"),
    Limit("compilation in a first run, event", "first_run_event", 15, beyond="later_run"),
    Limit("later run", "later_run"),
    Limit("first runs, many at once", "many_first_runs"),
    Limit("a shard's job, beyond its simulation", "more_shards", 1.5, beyond="one_shard", shared="jobs"),
)


def reached(bench: xr.Dataset) -> list[Reached]:
    """Return what became of each aim, in the order above."""
    return [_ratio(bench, aim) for aim in RATIOS] + [_time(bench, limit) for limit in TIMES]


def _ratio(bench: xr.Dataset, aim: Aim) -> Reached:
    aimed = f"at least {aim.at_least:g}" if aim.at_least else ""
    counted = not aim.share or "floating_point_operations" in bench.get(aim.under, xr.DataArray()).attrs
    if aim.over not in bench or aim.under not in bench or not counted:
        return Reached(aim.what, "1", aimed, math.nan, math.nan, None)
    over = samples_of(bench, aim.over)
    if aim.share:
        over = np.full_like(over, bench[aim.under].attrs["floating_point_operations"] * best_of(bench, aim.over))
    return _told(aim.what, "1", aimed, over / samples_of(bench, aim.under), aim.at_least)


def _time(bench: xr.Dataset, limit: Limit) -> Reached:
    aimed = f"at most {limit.at_most:g} s" if math.isfinite(limit.at_most) else ""
    if limit.case not in bench or (limit.beyond and limit.beyond not in bench):
        return Reached(limit.what, "s", aimed, math.nan, math.nan, None)
    values = samples_of(bench, limit.case)
    if limit.beyond:
        values = (values - np.nanmedian(samples_of(bench, limit.beyond))) / int(bench.attrs.get(limit.shared, 1))
    found = _told(limit.what, "s", aimed, values, 0)
    met = found.value <= limit.at_most if aimed else None
    return found._replace(met=met)


def _told(what: str, unit: str, aimed: str, values: Array, at_least: float) -> Reached:
    """Return the median of values, shape (round,), and what it means."""
    known = values[np.isfinite(values)]
    value = float(np.median(known)) if known.size else math.nan
    met = value >= at_least if at_least and known.size else None
    return Reached(what, unit, aimed, value, spread_of(values), met)
