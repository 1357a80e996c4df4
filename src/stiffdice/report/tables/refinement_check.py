"""The table that says how far a grid that grows where members disagree is from a dense one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.markdown_table import Table, rendered
from stiffdice.sweep.refinement_check import BINS, WIDTH, Scan, band, binned, bins, common, effort, scans
from stiffdice.sweep.stability_limits import EDGES

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
    (ours, our_error), (theirs, error) = (_exponent(data, law, criterion, edge) for data in (dense, found))
    if not np.isfinite([ours, our_error, theirs, error]).all():
        return ["", "", ""]
    apart = abs(ours - theirs) / max(np.hypot(our_error, error), 1e-12)
    return [f"{theirs:.4f} ± {error:.4f}", f"{ours:.4f} ± {our_error:.4f}", f"{apart:.1f}"]


def _exponent(found: xr.Dataset, law: str, criterion: str, edge: str) -> tuple[float, float]:
    contact = found.contact.values.tolist().index(meanings_of(found.contact).index(law))
    place = contact, meanings_of(found.criterion).index(criterion), list(EDGES).index(edge)
    return float(found.exponent.values[place]), float(found.exponent_error.values[place])
