"""The ledger of a run's energy: what is booked adds up to what the energy changed by."""

from __future__ import annotations

import numpy as np
import xarray as xr

from stiffdice.archive.consistency.tolerance import ROUNDING, outside, unequal
from stiffdice.simulation import energy_budget

_DEFECTS = ("spring_defect", "gravity_defect", "kick_defect")
_WORKS = ("damping_work", "drag_work", "friction_work", *_DEFECTS)


def problems(dataset: xr.Dataset, steps: int, duration: float, highest: float) -> list[str]:
    """Return a line for every account that does not add up.

    steps, duration [s]: of the run. highest: the largest energy of its states [J], by which a step's roundings count.
    """
    rows = dataset.sizes["bounce"]
    count = int(dataset["bounce_count"])
    found = outside("bounce_count", count, rows == min(count, energy_budget.LARGEST), f"{rows}, the rows of the ledger")
    found += _rows(dataset, steps, duration)
    for prefix in ("", "flight_", "bounce_"):
        parts = [dataset[prefix + name].values for name in _DEFECTS]
        roundings = 2 * ROUNDING * sum(map(np.abs, parts))
        work = f"{prefix}scheme_work"
        found += unequal(work, dataset[work].values, sum(parts), roundings, "its three defects")
    # Twelve roundings of energies in every step, which the compensated sums then keep.
    step = 12 * ROUNDING * (highest + float(np.max(dataset["bounce_largest_elastic_energy"].values, initial=0.0)))
    spans = dataset["bounce_last_step"].values - dataset["bounce_first_step"].values
    for prefix, before, after, steps_of in (
        ("", "launch_energy", "end_energy", np.asarray(steps)),
        ("bounce_", "bounce_energy_before", "bounce_energy_after", spans),
    ):
        booked = [dataset[prefix + name].values for name in _WORKS]
        room = steps_of * (step + 2 * ROUNDING * sum(map(np.abs, booked)))
        change = dataset[after].values - dataset[before].values
        found += unequal(f"sum of {prefix}works", sum(booked), change, room, "the change of the energy")
    if count <= energy_budget.LARGEST:
        found += _parts(dataset, steps)
    return found


def _rows(dataset: xr.Dataset, steps: int, duration: float) -> list[str]:
    """Bounces come one after another; the last step of one may be the first of the next."""
    first, last = dataset["bounce_first_step"].values, dataset["bounce_last_step"].values
    found = outside("bounce_last_step", last, (last > first) & (last <= steps), f"after its first step, up to {steps}")
    found += outside("bounce_first_step", first[1:], first[1:] >= last[:-1], "not before the bounce before has ended")
    for name, step in (("bounce_start", first), ("bounce_end", last)):
        right = step / steps * duration
        found += unequal(name, dataset[name].values, right, 2 * ROUNDING * right, "step / steps * duration")
    return found


def _parts(dataset: xr.Dataset, steps: int) -> list[str]:
    """A run is its flights and its bounces; a compensated sum rounds once, but for the square of a rounding a step."""
    found = []
    for name in energy_budget.AMOUNTS:
        whole, flights, rows = (dataset[prefix + name].values for prefix in ("", "flight_", "bounce_"))
        size = np.abs(whole) + np.abs(flights) + np.abs(rows).sum()
        room = (8 + len(rows) + steps * steps * ROUNDING) * ROUNDING * size
        found += unequal(name, whole, flights + rows.sum(), room, "that of the flights and of all bounces")
    return found
