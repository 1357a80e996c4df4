"""Engines in tables: their contacts, how long their steps may be, and how many they take in a second."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.experiments.engines import OUTCOMES, RATIOS
from stiffdice.experiments.work_precision.problems import PROBLEMS
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.markdown_table import Table, rendered
from stiffdice.report.methods import engines_note, name_of
from stiffdice.report.number_format import ground_words, readable, scene_of
from stiffdice.simulation.engines import registry as engines

# How far a restitution may be off at any phase, and what energy may be gained.
OFF = (0.05, 0.1)
GAIN = 0.02
# A nudge of a cube at rest, a hundredth of the sag, that has grown more lifts it off the ground.
GROWTH = 100.0

OURS = "symplectic_euler"

_SHORT = {
    "rest_depth": "depth at rest",
    "restitution": "restitution",
    "contact_time": "contact time",
    "rough_restitution": "restitution with friction",
    "friction": "friction",
}


def contact(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each method and ground: by how much its contact is off the exact one, at each ωh."""
    (found,) = experiments.values()
    found = found.sortby("omega_h")
    rows = []
    for (k, name), s, d in itertools.product(
        enumerate(meanings_of(found.method)), range(found.sizes["stiffness"]), range(found.sizes["damping"])
    ):
        there = found.isel(method=k, stiffness=s, damping=d)
        row = [name_of(name), readable(float(there.stiffness)), f"{float(there.damping):g}"]
        rows.append([*row, *(", ".join(map(_percent, there[ratio].values - 1)) for ratio in RATIOS)])
    note = (
        "By how much what was found differs from what is exact, at ωh = "
        f"{' and '.join(f'{part:g}' for part in found.omega_h.values)}; — where the cube did not leave the ground. "
        "Depth at rest: over m g/(4S), the mean of ten periods. Restitution: of a flat bounce, the mean over phases of "
        f"the step. Friction: horizontal over normal impulse, over mu. {engines_note([found])}"
    )
    return rendered(title, ["method", "S [kg/s²]", "D [kg/s]", *(_SHORT[name] for name in RATIOS)], rows, note)


def _percent(part: float) -> str:
    if math.isnan(part):
        return "—"
    return "0" if abs(part) < 5e-7 else f"{100 * part:+.2g} %".replace("-", "−")


class Limit(NamedTuple):
    """The longest ωh up to which all scanned ones pass, and the first that fails; NaN if none does."""

    passes: float
    fails: float

    def __str__(self) -> str:
        """Return it as a person reads it."""
        if math.isnan(self.fails):
            return f"≥ {self.passes:g}"
        return f"< {self.fails:.2g}" if math.isnan(self.passes) else f"{self.passes:.2g}"


def limit_of(omega_h: Array, passed: npt.NDArray[np.bool_]) -> Limit:
    """Return the limit of a criterion that holds at some of the scanned ωh, ascending, shape (omega_h,)."""
    failed = np.flatnonzero(~passed)
    if not failed.size:
        return Limit(float(omega_h[-1]), math.nan)
    first = int(failed[0])
    return Limit(float(omega_h[first - 1]) if first else math.nan, float(omega_h[first]))


def within(found: xr.Dataset, method: int, off: float) -> npt.NDArray[np.bool_]:
    """Return at which ωh the restitution is within a part of the exact one at every phase, shape (omega_h,)."""
    ratio = found.restitution.values[method] / float(found.exact_restitution)
    return np.asarray((np.abs(ratio - 1) <= off).all(axis=1))


def limits(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each method: how long its step may be by each criterion, and its restitution beyond."""
    (found,) = experiments.values()
    omega_h, exact = found.omega_h.values, float(found.exact_restitution)
    shown = sorted({int(np.abs(omega_h - 2.0).argmin()), len(omega_h) - 1})
    rows = []
    for k, name in enumerate(meanings_of(found.method)):
        restitution, outcomes = found.restitution.values[k], found.outcome.values[k]
        passed = [
            *(within(found, k, off) for off in OFF),
            (np.nan_to_num(restitution / exact, nan=0.0) ** 2 <= 1 + GAIN).all(axis=1),
            ~np.isin(outcomes, [OUTCOMES.index("sinks"), OUTCOMES.index("blows_up")]).any(axis=1),
            found.rest_growth.values[k] <= GROWTH,
            (outcomes != OUTCOMES.index("stays")).all(axis=1),
        ]
        rows.append([name_of(name), *(str(limit_of(omega_h, part)) for part in passed)])
        rows[-1] += [_span(restitution[place]) for place in shown]
    columns = ["method", *(f"e within {off:.0%}" for off in OFF), f"no energy gain above {GAIN:.0%}"]
    columns += ["whole", "stays at rest", "leaves the ground", *(f"e at ωh = {omega_h[place]:.3g}" for place in shown)]
    ground = scene_of(found)["ground"]
    note = (
        f"The longest ωh of {len(omega_h)} from {omega_h[0]:g} to {omega_h[-1]:g} up to which each of them passes, at "
        f"all of {found.sizes['phase']} phases of the step at touch-down. One flat bounce without friction, "
        f"{ground_words(stiffness=ground['stiffness'], damping=ground['damping'])}, exact restitution {exact:.6g}. "
        "Whole: it neither sinks through nor leaves the range of doubles. Stays at rest: a nudge by a hundredth of its "
        f"depth grows less than {GROWTH:g}-fold in 200 steps. {engines_note([found])}"
    )
    return rendered(title, columns, rows, note)


def _span(restitution: Array) -> str:
    """Return the least and the most over the phases at which the cube left the ground."""
    low, high = np.fmin.reduce(restitution), np.fmax.reduce(restitution)
    return "—" if math.isnan(low) else f"{low:.2g} … {high:.3g}"


def speed(timings: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each method: steps a second of each problem, and how many times as many ours does."""
    (found,) = timings.values()
    names = meanings_of(found.method)
    rates = found.taken.values / found.seconds.values
    ours = rates[:, names.index(OURS)] if OURS in names else np.full(len(rates), np.nan)
    rows = []
    for k, name in enumerate(names):
        row = [name_of(name), "force evaluations" if engines.METHODS[name].own_steps else "steps"]
        for p in range(len(rates)):
            row += [_count(rates[p, k]), _count(ours[p] / rates[p, k])]
        rows.append([*row, f"{100 * np.nanmax(found.spread.values[:, k]):.2g} %"])
    columns = ["method", "what is counted"]
    for problem in meanings_of(found.problem):
        columns += [f"{PROBLEMS[problem].name} [1/s]", "ours over it"]
    note = (
        f"Medians of {found.attrs['rounds']} interleaved rounds, of {found.attrs['steps']:,} steps each, on one thread "
        f"of {found.attrs['machine_processor']}; what took long, once. Ours: {name_of(OURS)}, plain stepping. Engines "
        f"are started before the clock is. Spread: half the range between the quartiles. {engines_note([found])}"
    )
    return rendered(title, [*columns, "spread"], rows, note)


def _count(value: float) -> str:
    return "—" if math.isnan(value) else readable(value, digits=2)
