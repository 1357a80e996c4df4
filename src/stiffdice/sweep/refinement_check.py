"""Does a grid that grows where members disagree give the answer of a dense one? Both side by side, with their errors.

Two scans of one density that differ in their jitter do not find the same edges: an edge is an extreme value, decided by
whichever cell chance put last. What they may differ by is told from the dense scan itself, cell by cell.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.errors import InputError
from stiffdice.io.cf_enums import meanings_of
from stiffdice.sweep import stability_limits

# Gaps between failing cells that say how often a cell fails near the edge, and cells to which two scans tell an edge at
# best. Measured on re-jittered dense scans, 92 to 98 % of their edges then lie in each other's bands.
GAPS, BEST = 5, 2
# Bins in which pass fractions are compared: several cells of a dense scan each, so that teeth of a comb do not matter.
BINS = 50
# Half the width of a 95 % interval in standard errors.
WIDTH = 1.96


class Scan(NamedTuple):
    """What was scanned of one column for one criterion: steps, ascending, and pass fractions."""

    steps: npt.NDArray[np.int64]
    shares: Array

    @property
    def edges(self) -> dict[str, float]:
        """Return what `stability_limits.edges` finds in it."""
        return stability_limits.edges(self.steps, self.shares == 1)


class Band(NamedTuple):
    """Where an edge lies in 95 % of scans with another jitter, and the standard error of its logarithm."""

    low: float  # [1] steps
    high: float  # [1] steps
    error: float


class Column(NamedTuple):
    """One scan's place in a sweep: names of contact law and criterion, stiffness [kg/s²]."""

    contact: str
    criterion: str
    stiffness: float


def scans(found: xr.Dataset) -> dict[Column, Scan]:
    """Return all scans of a frontier."""
    names, criteria, steps = meanings_of(found.contact), meanings_of(found.criterion), found.cell_steps.values
    laws, stiffnesses, cells = stability_limits.scans(found.cell_contact.values, found.cell_stiffness.values, steps)
    shares = found.pass_fraction.values
    return {
        Column(names[law], criterion, stiffness): Scan(steps[here], shares[c, here])
        for (law, stiffness), here in zip(product(laws, stiffnesses.tolist()), cells, strict=True)
        for c, criterion in enumerate(criteria)
    }


def band(scan: Scan, edge: str) -> Band:
    """Return where scans as dense as this one, but jittered otherwise, find an edge 19 times of 20; NaN if it has none.

    Say a share r of the cells fails, each by itself, up to an end that nobody knows. The last that fails is then a
    geometric number of cells short of it, and two scans' last ones lie m cells apart or more in about (1 − r)^m of all
    cases. r is told by the last few gaps between failing cells (at the other edge, the first few between passing ones).
    """
    steps = scan.edges[edge]
    if np.isnan(steps):
        return Band(np.nan, np.nan, np.nan)
    fails = scan.shares < 1
    last = np.flatnonzero(fails if edge != "first_pass" else ~fails[::-1])[::-1]
    gaps = -np.diff(np.append(last, -1))[:GAPS]  # where there are few, the scan's beginning is one
    rate = 1 / gaps.mean()
    apart = BEST + (np.log(20) / -np.log1p(-rate) if rate < 1 else 0.0)
    here = int(np.searchsorted(scan.steps, steps))
    below, above = max(here - GAPS, 0), min(here + GAPS, len(fails) - 1)
    cell = np.log(scan.steps[above] / scan.steps[below]) / (above - below)
    half = float(apart * cell)
    return Band(steps * np.exp(-half), steps * np.exp(half), half / (np.sqrt(2) * WIDTH))


def binned(scan: Scan, ends: Array) -> tuple[Array, Array]:
    """Return the mean pass fraction between ends [log of steps], shape (bin,), and its standard error.

    A cell counts for the steps nearest to it, so that crowded cells count less each. Its variance is told by how far it
    is from the mean of its neighbours, which a chance of members, a comb's teeth and the slope all add to (von Neumann
    1941, doi:10.1214/aoms/1177731677): rather too much.
    """
    places, shares = np.log(scan.steps), scan.shares
    limits = np.concatenate([ends[:1], (places[1:] + places[:-1]) / 2, ends[-1:]]).clip(ends[0], ends[-1])
    shared = np.minimum(limits[None, 1:], ends[1:, None]) - np.maximum(limits[None, :-1], ends[:-1, None])
    weights = shared.clip(0) / shared.clip(0).sum(axis=1, keepdims=True)
    around = np.concatenate([shares[1:2], shares, shares[-2:-1]])
    variance = (shares - (around[2:] + around[:-2]) / 2) ** 2 * 2 / 3
    return weights @ shares, np.sqrt(weights**2 @ variance)


def bins(*compared: Scan) -> Array:
    """Return the ends [log of steps] of BINS bins over the span that all scans have."""
    first, last = max(scan.steps[0] for scan in compared), min(scan.steps[-1] for scan in compared)
    return np.linspace(np.log(first), np.log(last), BINS + 1)


def effort(found: xr.Dataset, law: str | None = None) -> tuple[int, int]:
    """Return the runs of a sweep, and the steps that they ask for, under one contact law or all."""
    steps = found.cell_steps.values
    if law is not None:
        steps = steps[found.cell_contact.values == meanings_of(found.contact).index(law)]
    members = int(found.attrs["members"])
    return members * len(steps), members * int(steps.sum())


def common(sweeps: Mapping[str, xr.Dataset]) -> list[Column]:
    """Return the scans that all sweeps have.

    Raises InputError unless there are two sweeps or more of one scene, model, scheme and number of members that ask a
    criterion at one tolerance, and have a scan in common.
    """
    first, *others = sweeps.values()
    if not others:
        raise InputError("refinement-check: needs a dense sweep and one or more to compare with it")
    for name, found in sweeps.items():
        for key in ("scene_digest", "model", "scheme", "simulator", "members"):
            if found.attrs[key] != first.attrs[key]:
                raise InputError(f"refinement-check: sweep {name} has another {key.partition('_')[0]} than the first")
        asked, wanted = (
            dict(zip(meanings_of(part.criterion), part.tolerance.values, strict=True)) for part in (found, first)
        )
        if asked != wanted:
            raise InputError(f"refinement-check: sweep {name} has other criteria than the first, or tolerances")
    found_in, columns = [scans(found) for found in sweeps.values()], []
    for column in found_in[0]:
        steps = [parts[column].steps for parts in found_in if column in parts]
        # A span of steps in common, and cells enough to tell errors from.
        overlap = max(scan[0] for scan in steps) < min(scan[-1] for scan in steps)
        if len(steps) == len(found_in) and min(map(len, steps)) > 2 and overlap:
            columns.append(column)
    if not columns:
        raise InputError("refinement-check: needs sweeps with a contact law, stiffness and span of steps in common")
    return columns
