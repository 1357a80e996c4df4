"""Does a grid that grows where members disagree give the answer of a dense one? Both side by side, with their errors.

Two scans of one density that differ in their jitter do not find the same edges: an edge is an extreme value, decided by
whichever cell chance put last. What they may differ by is told from the dense scan itself, cell by cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.errors import InputError
from stiffdice.frontier import EDGES, edges
from stiffdice.io.enums import meanings_of
from stiffdice.state import Array
from stiffdice.table import Table, rendered

# Gaps between failing cells that say how often a cell fails near the edge, and cells to which two scans tell an edge at
# best. Measured on re-jittered dense scans, 92 to 98 % of their edges then lie in each other's bands.
GAPS, BEST = 5, 2
# Bins in which pass fractions are compared: several cells of a dense scan each, so that teeth of a comb do not matter.
BINS = 50
# Half the width of a 95 % interval in standard errors.
WIDTH = 1.96

_COLUMNS = (
    "sweep",
    "contact law",
    "criterion",
    "what",
    "runs",
    "of the dense grid's",
    "of its steps",
    "compared",
    "equal",
    "within the 95 % band",
    "median difference",
    "largest",
    "largest in standard errors",
    "exponent",
    "dense exponent",
    "apart in standard errors",
)


class Scan(NamedTuple):
    """What was scanned of one column for one criterion: steps, ascending, and pass fractions."""

    steps: npt.NDArray[np.int64]
    shares: Array

    @property
    def edges(self) -> dict[str, float]:
        """Return what `frontier.edges` finds in it."""
        return edges(self.steps, self.shares == 1)


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
    laws, criteria = meanings_of(found.contact), meanings_of(found.criterion)
    parts = {}
    for law in found.contact.values.tolist():
        for stiffness in found.stiffness.values.tolist():
            here = (found.cell_contact.values == law) & (found.cell_stiffness.values == stiffness)
            steps = found.cell_steps.values[here]
            order = np.argsort(steps, kind="stable")
            for c, criterion in enumerate(criteria):
                shares = found.pass_fraction.values[c, here][order]
                parts[Column(laws[law], criterion, stiffness)] = Scan(steps[order], shares)
    return parts


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
        raise InputError("elastic: needs a dense sweep and one or more to compare with it")
    for name, found in sweeps.items():
        for key in ("scene_digest", "model", "scheme", "simulator", "members"):
            if found.attrs[key] != first.attrs[key]:
                raise InputError(f"elastic: sweep {name} has another {key.partition('_')[0]} than the first")
        if _tolerances(found) != _tolerances(first):
            raise InputError(f"elastic: sweep {name} asks other criteria than the first, or at other tolerances")
    found_in = [scans(found) for found in sweeps.values()]
    columns = [column for column in found_in[0] if all(column in parts for parts in found_in)]
    columns = [column for column in columns if _overlap([parts[column] for parts in found_in])]
    if not columns:
        raise InputError("elastic: needs sweeps that have a contact law, a stiffness and a span of steps in common")
    return columns


def _overlap(compared: Sequence[Scan]) -> bool:
    """Return whether scans have a span of steps in common, and cells enough to tell errors from."""
    ends = [(int(scan.steps[0]), int(scan.steps[-1])) for scan in compared]
    return min(len(scan.steps) for scan in compared) > 2 and max(low for low, _ in ends) < min(high for _, high in ends)


def _tolerances(found: xr.Dataset) -> dict[str, float]:
    return dict(zip(meanings_of(found.criterion), found.tolerance.values.tolist(), strict=True))


def table(sweeps: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return, for each sweep but the first, how its edges, exponents and pass fractions differ from the first's.

    sweeps: frontiers, the dense one first. Raises InputError if they cannot be compared.
    """
    columns = common(sweeps)
    (dense_name, dense), *others = sweeps.items()
    pairs = list(dict.fromkeys((column.contact, column.criterion) for column in columns))
    of_dense = scans(dense)
    rows = []
    for name, found in others:
        of_found = scans(found)
        for law, criterion in pairs:
            (runs, steps), (all_runs, all_steps) = effort(found, law), effort(dense, law)
            head = [name, law, criterion]
            size = [f"{runs:,}", f"{runs / all_runs:.1%}", f"{steps / all_steps:.1%}"]
            both = [(of_dense[column], of_found[column]) for column in columns if column[:2] == (law, criterion)]
            for edge in EDGES:
                rows.append([*head, edge, *size, *_edge(both, edge), *_exponents(dense, found, law, criterion, edge)])
            rows.append([*head, "pass fraction", *size, *_shares(both), "", "", ""])
    runs = effort(dense)[0]
    note = (
        f"Compared with {dense_name}, {runs:,} runs. Bands and standard errors of an edge: by the gaps between the "
        "failing cells next to it in the dense scan; two scans that differ in their jitter alone are √2 of them apart, "
        f"which is allowed for. Pass fractions: in {BINS} bins over the logarithm of the steps, without those in which "
        "every cell of both passes, or every one fails. Steps: as asked, before early ends and skipped flights."
    )
    return rendered(title, _COLUMNS, rows, note)


def _edge(both: list[tuple[Scan, Scan]], edge: str) -> list[str]:
    """Return how many edges are compared, are equal and lie within the band, and how far apart they are."""
    apart, errors, equal, within = [], [], 0, 0
    for dense, other in both:
        ours, theirs = dense.edges[edge], other.edges[edge]
        if np.isnan(ours) and np.isnan(theirs):
            continue
        limits = band(dense, edge)
        equal += ours == theirs
        within += limits.low <= theirs <= limits.high
        apart.append(abs(theirs / ours - 1))
        errors.append(abs(np.log(theirs / ours)) / (np.sqrt(2) * limits.error))
    return _told(apart, errors, int(equal), int(within))


def _shares(both: list[tuple[Scan, Scan]]) -> list[str]:
    """Return the same of pass fractions in bins, their differences in hundredths of all members."""
    apart, errors = [np.zeros(0)], [np.zeros(0)]
    for dense, other in both:
        ends = bins(dense, other)
        (ours, error), (theirs, other_error) = (binned(scan, ends) for scan in (dense, other))
        together = np.hypot(error, other_error)
        clear = (together == 0) & (ours == theirs)
        apart.append(np.abs(theirs - ours)[~clear])
        errors.append(apart[-1] / np.maximum(together[~clear], 1e-12))
    differences, in_errors = np.concatenate(apart), np.concatenate(errors)
    equal, within = int((differences == 0).sum()), int((in_errors <= WIDTH).sum())
    return _told(list(differences), list(in_errors), equal, within)


def _told(apart: list[float], errors: list[float], equal: int, within: int) -> list[str]:
    if not apart:
        return ["0", "", "", "", "", ""]
    whole = len(apart)
    largest = [f"{np.median(apart):.2%}", f"{np.max(apart):.2%}", f"{np.max(errors):.1f}"]
    return [str(whole), str(equal), f"{within / whole:.1%}", *largest]


def _exponents(dense: xr.Dataset, found: xr.Dataset, law: str, criterion: str, edge: str) -> list[str]:
    """Return both exponents of the power law through an edge, and how far apart they are in standard errors."""
    ours, theirs = (_exponent(data, law, criterion, edge) for data in (dense, found))
    if not np.isfinite([*ours, *theirs]).all():
        return ["", "", ""]
    apart = abs(ours[0] - theirs[0]) / max(np.hypot(ours[1], theirs[1]), 1e-12)
    return [f"{theirs[0]:.4f} ± {theirs[1]:.4f}", f"{ours[0]:.4f} ± {ours[1]:.4f}", f"{apart:.1f}"]


def _exponent(found: xr.Dataset, law: str, criterion: str, edge: str) -> tuple[float, float]:
    here = {
        "contact": found.contact.values.tolist().index(meanings_of(found.contact).index(law)),
        "criterion": meanings_of(found.criterion).index(criterion),
        "edge": list(EDGES).index(edge),
    }
    return tuple(float(found[name].isel(here)) for name in ("exponent", "exponent_error"))  # type: ignore[return-value]
