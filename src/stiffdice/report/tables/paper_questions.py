"""The questions that the paper leaves open at one stiffness, answered from scans over steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.markdown_table import Table, rendered
from stiffdice.report.number_format import scene_of
from stiffdice.scene import scene as scenes
from stiffdice.sweep.refinement_check import Column, Scan, scans

# The paper's two choices at S = 10⁶ (its figures 9 and 11), and a number of steps a little above the second.
CHOICES = (10_000, 20_000, 23_000)
# Scanned cells this near to a number of steps answer for it: a scan is jittered off round numbers.
NEAR = 0.005


def table(sweeps: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each question and criterion, a column for each contact law.

    sweeps: frontiers, of which the stiffest ground that all of them have is told. Raises InputError if there is none.
    """
    _refuse_strangers(sweeps)
    found = [scans(data) for data in sweeps.values()]
    common = set.intersection(*({column.stiffness for column in parts} for parts in found))
    if not common:
        raise InputError("paper-questions: needs sweeps that have a stiffness in common")
    stiffness = max(common)
    scene = scenes.from_mapping(scene_of(next(iter(sweeps.values())))).with_ground(stiffness=stiffness)
    laws = list(dict.fromkeys(column.contact for parts in found for column in parts))
    criteria = list(dict.fromkeys(column.criterion for parts in found for column in parts))
    columns = [Column(law, criterion, stiffness) for criterion in criteria for law in laws]
    merged = {column: _merged([parts[column] for parts in found if column in parts]) for column in columns}
    rows = [
        [question, criterion, *(answer(merged[Column(law, criterion, stiffness)]) for law in laws)]
        for question, answer in _questions(partial(linear_theory.omega_h, scene)).items()
        for criterion in criteria
    ]
    scanned = np.concatenate([scan.steps for scan in merged.values()])
    note = (
        f"S = {stiffness:g} kg/s². Near a number of steps: all members of all scanned cells within {NEAR:.1%} of it. "
        f"Members are spread over the phase of the touch-down. Scanned: {scanned.min():,} to {scanned.max():,} steps; "
        "between sweeps there may be holes."
    )
    return rendered(title, ["question", "criterion", *laws], rows, note)


def _questions(omega_h: Callable[[float], float]) -> dict[str, Callable[[Scan], str]]:
    """Return what is asked of each scan, by the question's words."""
    near = {
        f"members passing near {choice:,} steps (ωh = {omega_h(choice):.3g})": partial(_passing, choice)
        for choice in CHOICES
    }
    return near | {
        f"steps about {CHOICES[1]:,} at which every member passes": _window,
        "fewest steps at which every member passes": partial(_edge, "first_pass", omega_h),
        "most steps at which a member fails": partial(_edge, "last_fail", omega_h),
        "steps from which on every member passes": partial(_edge, "steps_needed", omega_h),
        "changes between pass and fail along the scan": _flips,
    }


def _passing(choice: int, scan: Scan) -> str:
    near = scan.shares[np.abs(scan.steps / choice - 1) <= NEAR]
    return f"{near.mean():.1%}" if near.size else "not scanned"


def _window(scan: Scan) -> str:
    """Return the span around the paper's second choice in which no scanned cell has a member that fails."""
    away = np.abs(scan.steps / CHOICES[1] - 1)
    if away.min(initial=math.inf) > NEAR:
        return "not scanned"
    middle, bad = int(np.argmin(away)), np.flatnonzero(scan.shares < 1)
    if middle in bad:
        return "none"
    start = scan.steps[bad[bad < middle].max(initial=-1) + 1]
    end = scan.steps[bad[bad > middle].min(initial=len(scan.steps)) - 1]
    return f"{start:,} to {end:,}" + ("" if (bad > middle).any() else " and more")


def _edge(name: str, omega_h: Callable[[float], float], scan: Scan) -> str:
    if not scan.steps.size:
        return "not scanned"
    if name != "last_fail" and (scan.shares == 1).all():
        return f"{scan.steps[0]:,} or fewer"
    if name == "last_fail" and scan.shares[-1] < 1:
        return f"{scan.steps[-1]:,} or more"
    steps = scan.edges[name]
    return "none" if math.isnan(steps) else f"{steps:,.0f} (ωh = {omega_h(steps):.3g})"


def _flips(scan: Scan) -> str:
    return f"{scan.edges['flips']:.0f}" if scan.steps.size else "not scanned"


def _merged(parts: Sequence[Scan]) -> Scan:
    """Return scans as one."""
    steps = np.concatenate([np.zeros(0, np.int64), *(part.steps for part in parts)])
    shares = np.concatenate([np.zeros(0), *(part.shares for part in parts)])
    order = np.argsort(steps, kind="stable")
    return Scan(steps[order], shares[order])


def _refuse_strangers(sweeps: Mapping[str, xr.Dataset]) -> None:
    """Raise InputError unless all sweeps are of one scene and model, and ask a criterion at one tolerance."""
    asked: dict[str, float] = {}
    for name, found in sweeps.items():
        for key in ("scene_digest", "model", "scheme"):
            if found.attrs[key] != next(iter(sweeps.values())).attrs[key]:
                raise InputError(f"paper-questions: sweep {name} has another {key.partition('_')[0]} than the first")
        for criterion, tolerance in zip(meanings_of(found.criterion), found.tolerance.values, strict=True):
            if asked.setdefault(criterion, float(tolerance)) != float(tolerance):
                raise InputError(f"paper-questions: sweep {name} asks {criterion} at another tolerance than the first")
