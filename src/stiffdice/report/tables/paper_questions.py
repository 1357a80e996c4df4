"""The questions that the paper leaves open at one stiffness, answered from scans over steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import Array
from stiffdice.errors import InputError
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.markdown_table import Table, rendered
from stiffdice.report.number_format import scene_of
from stiffdice.scene import scene as scenes
from stiffdice.sweep.stability_limits import edges

# The paper's two choices at S = 10⁶ (its figures 9 and 11), and a number of steps a little above the second.
CHOICES = (10_000, 20_000, 23_000)
# Scanned cells this near to a number of steps answer for it: a scan is jittered off round numbers.
NEAR = 0.005


class Scan(NamedTuple):
    """All that was scanned under one contact law for one criterion: steps, ascending, and the share that passes."""

    steps: npt.NDArray[np.int64]
    shares: Array


def table(sweeps: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each question and criterion, a column for each contact law.

    sweeps: frontiers, of which the stiffest ground that all of them have is told. Raises InputError if there is none.
    """
    stiffness = _common_stiffness(list(sweeps.values()))
    _refuse_strangers(sweeps)
    first = next(iter(sweeps.values()))
    scene = scenes.from_mapping(scene_of(first)).with_ground(stiffness=stiffness)

    def omega_h(steps: float) -> float:
        return linear_theory.omega_h(scene, steps)

    laws = list(dict.fromkeys(meanings_of(found.contact)[k] for found in sweeps.values() for k in found.contact.values))
    criteria = list(dict.fromkeys(name for found in sweeps.values() for name in meanings_of(found.criterion)))
    scans = {
        (criterion, law): _scan(list(sweeps.values()), stiffness, criterion, law)
        for criterion in criteria
        for law in laws
    }
    rows = [
        [question, criterion, *(answer(scans[criterion, law]) for law in laws)]
        for question, answer in _questions(omega_h).items()
        for criterion in criteria
    ]
    scanned = np.concatenate([scan.steps for scan in scans.values()])
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
    good = scan.shares == 1
    away = np.abs(scan.steps / CHOICES[1] - 1)
    if not away.size or away.min() > NEAR:
        return "not scanned"
    middle = int(np.argmin(away))
    if not good[middle]:
        return "none"
    bad = np.flatnonzero(~good)
    below, above = bad[bad < middle], bad[bad > middle]
    start = scan.steps[below[-1] + 1] if below.size else scan.steps[0]
    end = scan.steps[above[0] - 1] if above.size else scan.steps[-1]
    return f"{start:,} to {end:,} and more" if not above.size else f"{start:,} to {end:,}"


def _edge(name: str, omega_h: Callable[[float], float], scan: Scan) -> str:
    if not scan.steps.size:
        return "not scanned"
    steps = _edges(scan)[name]
    if name != "last_fail" and (scan.shares == 1).all():
        return f"{scan.steps[0]:,} or fewer"
    if name == "last_fail" and scan.shares[-1] < 1:
        return f"{scan.steps[-1]:,} or more"
    return "none" if math.isnan(steps) else f"{steps:,.0f} (ωh = {omega_h(steps):.3g})"


def _flips(scan: Scan) -> str:
    return f"{_edges(scan)['flips']:.0f}" if scan.steps.size else "not scanned"


def _edges(scan: Scan) -> dict[str, float]:
    """Return the edges of a scan with cells."""
    return edges(scan.steps, scan.shares == 1)


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


def _common_stiffness(sweeps: Sequence[xr.Dataset]) -> float:
    common = set.intersection(*(set(found.stiffness.values.tolist()) for found in sweeps))
    if not common:
        raise InputError("paper-questions: needs sweeps that have a stiffness in common")
    return float(max(common))


def _scan(sweeps: Sequence[xr.Dataset], stiffness: float, criterion: str, law: str) -> Scan:
    """Return the cells of all sweeps at one stiffness as one scan."""
    steps, shares = [np.zeros(0, np.int64)], [np.zeros(0)]
    for found in sweeps:
        names = meanings_of(found.criterion)
        if criterion in names:
            here = (found.cell_stiffness.values == stiffness) & (
                found.cell_contact.values == meanings_of(found.contact).index(law)
            )
            steps.append(found.cell_steps.values[here])
            shares.append(found.pass_fraction.values[names.index(criterion), here])
    order = np.argsort(np.concatenate(steps), kind="stable")
    return Scan(np.concatenate(steps)[order], np.concatenate(shares)[order])
