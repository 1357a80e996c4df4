"""Engines in tables: their contacts, how long their steps may be, and how many they take in a second."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.experiments.engines.contact import RATIOS
from stiffdice.experiments.engines.single_bounce import MODEL as BOUNCE_MODEL
from stiffdice.experiments.engines.single_bounce import OUTCOMES
from stiffdice.experiments.work_precision.problems import PROBLEMS
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.markdown_table import Table, rendered
from stiffdice.report.methods import engines_note, name_of
from stiffdice.report.number_format import ground_words, readable, scene_of
from stiffdice.scene import scene as scenes
from stiffdice.simulation.engines import stepper

# A ratio that differs from one by less is right.
_RIGHT = 1e-3
# What falls as the step does falls at least to so much of what the ratio of the steps says.
_FALLS = 2.0

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
    """Return a row for each method and ground: by how much its contact is off the exact one, at each ωh, and what is.

    experiments: one, as `experiments.engine_contact.measure` makes it.
    """
    (found,) = experiments.values()
    order = np.argsort(found.omega_h.values)
    values = found.omega_h.values[order].tolist()
    columns = ["method", "S [kg/s²]", "D [kg/s]", *(_SHORT[name] for name in RATIOS)]
    rows = []
    for k, name in enumerate(meanings_of(found.method)):
        for s, d in np.ndindex(found.sizes["stiffness"], found.sizes["damping"]):
            there = found.isel(method=k, stiffness=s, damping=d)
            off = {ratio: there[ratio].values[order] - 1 for ratio in RATIOS}
            row = [name_of(name), readable(float(there.stiffness)), f"{float(there.damping):g}"]
            rows.append([*row, *(", ".join(map(_percent, off[ratio])) for ratio in RATIOS), _what_is_off(off, values)])
    note = (
        f"By how much what was found differs from what is exact, at ωh = {' and '.join(f'{part:g}' for part in values)}"
        "; — where the cube did not leave the ground. Depth at rest: over m g/(4S), the mean of ten periods. "
        "Restitution: of a flat bounce, the mean over phases of the step. Friction: horizontal over normal impulse, "
        f"over mu. What is off by less than {_RIGHT:.1%} is left out. {engines_note([found])}"
    )
    return rendered(title, [*columns, "what is off"], rows, note)


def _percent(part: float) -> str:
    if math.isnan(part):
        return "—"
    return "0" if abs(part) < 5e-7 else f"{100 * part:+.2g} %".replace("-", "−")


def _what_is_off(off: Mapping[str, Array], omega_h: list[float]) -> str:
    """Return what is off at the shortest step, and whether a shorter one would help; omega_h: ascending."""
    parts = []
    for name, values in off.items():
        here, there = float(values[0]), float(values[-1])
        same = name == "rough_restitution" and abs(here - float(off["restitution"][0])) < _RIGHT
        if math.isnan(here):
            parts.append(f"{_SHORT[name]}: it does not leave the ground")
        elif abs(here) >= _RIGHT and not same:
            falls = abs(here) * omega_h[-1] / omega_h[0] < _FALLS * abs(there)
            parts.append(f"{_SHORT[name]} {_percent(here)}, {'falls with the step' if falls else 'whatever the step'}")
    return "; ".join(parts) or "nothing"


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
    """Return a row for each method: how long its step may be by each criterion, and what happens beyond.

    experiments: one, as `experiments.engine_limits.measure` makes it.
    """
    (found,) = experiments.values()
    omega_h = found.omega_h.values
    rows = []
    for k, name in enumerate(meanings_of(found.method)):
        ratio = found.restitution.values[k] / float(found.exact_restitution)
        grave = np.isin(found.outcome.values[k], [OUTCOMES.index("sinks"), OUTCOMES.index("blows_up")])
        passed = [
            *(within(found, k, off) for off in OFF),
            (np.nan_to_num(ratio, nan=0.0) ** 2 <= 1 + GAIN).all(axis=1),
            ~grave.any(axis=1),
            found.rest_growth.values[k] <= GROWTH,
        ]
        limits = [str(limit_of(omega_h, part)) for part in passed]
        rows.append([name_of(name), *limits, beyond(found, k), cannot(name)])
    columns = ["method", *(f"e within {off:.0%}" for off in OFF), f"no energy gain above {GAIN:.0%}"]
    columns += ["whole", "stays at rest", "beyond", "cannot represent"]
    ground = scene_of(found)["ground"]
    note = (
        f"The longest ωh of {len(omega_h)} from {omega_h[0]:g} to {omega_h[-1]:g} up to which each of them passes, at "
        f"all of {found.sizes['phase']} phases of the step at touch-down. One flat bounce without friction, "
        f"{ground_words(stiffness=ground['stiffness'], damping=ground['damping'])}, exact restitution "
        f"{float(found.exact_restitution):.6g}. Whole: it neither sinks through nor leaves the range of doubles. Stays "
        f"at rest: a nudge by a hundredth of its depth grows less than {GROWTH:g}-fold in 200 steps. "
        f"{engines_note([found])}"
    )
    return rendered(title, columns, rows, note)


def beyond(found: xr.Dataset, method: int) -> str:
    """Return what happens to bounces of a method from where they are off by more than a tenth, in words."""
    omega_h, passed = found.omega_h.values, within(found, method, OFF[-1])
    if passed.all():
        return "nothing up to the end of the scan"
    first = int(np.argmin(passed))
    ratio = found.restitution.values[method] / float(found.exact_restitution)
    there = ratio[first:]
    parts = []
    if np.nanmax(there) ** 2 > 1 + GAIN:
        lowest = np.nanmin(there) < 1 - OFF[-1]
        parts.append("gains energy at some phases, loses it at others" if lowest else "gains energy")
    elif np.nanmin(there) < 1:
        parts.append("loses energy")
    for value in (2.0, float(omega_h[-1])):
        k = int(np.argmin(np.abs(omega_h - value)))
        if k >= first and np.isfinite(ratio[k]).any():
            parts.append(f"e = {np.nanmin(ratio[k]):.2g} … {np.nanmax(ratio[k]):.3g} at ωh = {omega_h[k]:.3g}")
    words = {"stays": "stays on the ground", "sinks": "sinks through", "blows_up": "leaves the range of doubles"}
    for outcome, text in words.items():
        seen = np.flatnonzero((found.outcome.values[method] == OUTCOMES.index(outcome)).any(axis=1))
        if seen.size:
            parts.append(f"{text} from ωh = {omega_h[seen[0]]:.2g}")
    return "; ".join(parts)


# Scenes by what is peculiar to them: keys, preset and model.
_SCENES: dict[str, tuple[dict[str, Any], str, str]] = {
    "the listings' law (ungated)": ({"launch": {"angular_momentum": [0.3, 0.5, 0.2]}}, "as_listed", "tumbling"),
    "tilted ground": ({"ground": {"normal": [0.2, 0.0, 1.0]}}, "as_written", BOUNCE_MODEL),
}

# What an engine represents otherwise; its adapter says more.
_OTHERWISE = {
    "mujoco": "friction at the node: its acts half way down to the surface",
    "pybullet": "friction along the slip of a cube that turns: its points elsewhere",
    "drake": "friction that leaves the normal force alone: a slip u adds (D + S h) μ u to it",
}


def cannot(method: str) -> str:
    """Return what of the paper's scenes a method cannot represent, in words."""
    unfit = [
        words
        for words, (keys, preset, model) in _SCENES.items()
        if stepper.unfit(method, scenes.from_mapping(keys, preset), model) is not None
    ]
    return "; ".join([*unfit, *([_OTHERWISE[method]] if method in _OTHERWISE else [])]) or "—"


def speed(timings: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each method: steps a second of each problem, and how many times as many ours does.

    timings: one, as `experiments.engine_speed.time` makes it.
    """
    (found,) = timings.values()
    names = meanings_of(found.method)
    rates = found.taken.values / found.seconds.values
    ours = rates[:, names.index(OURS)] if OURS in names else np.full(len(rates), np.nan)
    rows = []
    for k, name in enumerate(names):
        row = [name_of(name), "force evaluations" if stepper.own_steps(name) else "steps"]
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
