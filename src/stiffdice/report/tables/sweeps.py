"""Tables of sweeps: the questions that the paper leaves open at one stiffness, and how far an adaptive grid is off."""

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
from stiffdice.sweep import refinement_check as refined
from stiffdice.sweep.refinement_check import BINS, Column, Scan, scans
from stiffdice.sweep.stability_limits import EDGES

# The paper's two choices at S = 10⁶ (its figures 9 and 11), and a number of steps a little above the second.
CHOICES = (10_000, 20_000, 23_000)
# Scanned cells this near to a number of steps answer for it: a scan is jittered off round numbers.
NEAR = 0.005

_REFINED = (
    *("sweep", "contact law", "criterion", "what", "runs", "of the dense grid's", "of its steps", "compared", "equal"),
    *("within the 95 % band", "median difference", "largest", "largest in standard errors"),
    *("exponent", "dense exponent", "apart in standard errors"),
)


def paper_questions(sweeps: Mapping[str, xr.Dataset], title: str) -> Table:
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
    omega_h = partial(linear_theory.omega_h, scene)
    questions: dict[str, Callable[[Scan], str]] = {
        f"members passing near {choice:,} steps (ωh = {omega_h(choice):.3g})": partial(_passing, choice)
        for choice in CHOICES
    }
    questions |= {
        f"steps about {CHOICES[1]:,} at which every member passes": _window,
        "fewest steps at which every member passes": partial(_edge_of, "first_pass", omega_h),
        "most steps at which a member fails": partial(_edge_of, "last_fail", omega_h),
        "steps from which on every member passes": partial(_edge_of, "steps_needed", omega_h),
        "changes between pass and fail along the scan": lambda scan: (
            f"{scan.edges['flips']:.0f}" if scan.steps.size else "not scanned"
        ),
    }
    rows = [
        [question, criterion, *(answer(merged[Column(law, criterion, stiffness)]) for law in laws)]
        for question, answer in questions.items()
        for criterion in criteria
    ]
    scanned = np.concatenate([scan.steps for scan in merged.values()])
    note = (
        f"S = {stiffness:g} kg/s². Near a number of steps: all members of all scanned cells within {NEAR:.1%} of it. "
        f"Members are spread over the phase of the touch-down. Scanned: {scanned.min():,} to {scanned.max():,} steps; "
        "between sweeps there may be holes."
    )
    return rendered(title, ["question", "criterion", *laws], rows, note)


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


def _edge_of(name: str, omega_h: Callable[[float], float], scan: Scan) -> str:
    if not scan.steps.size:
        return "not scanned"
    if name != "last_fail" and (scan.shares == 1).all():
        return f"{scan.steps[0]:,} or fewer"
    if name == "last_fail" and scan.shares[-1] < 1:
        return f"{scan.steps[-1]:,} or more"
    steps = scan.edges[name]
    return "none" if math.isnan(steps) else f"{steps:,.0f} (ωh = {omega_h(steps):.3g})"


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


def refinement_check(sweeps: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return, for each sweep but the first, how its edges, exponents and pass fractions differ from the first's.

    sweeps: frontiers, the dense one first. Raises InputError if they cannot be compared.
    """
    columns = refined.common(sweeps)
    (dense_name, dense), *others = sweeps.items()
    pairs = list(dict.fromkeys((column.contact, column.criterion) for column in columns))
    of_dense = scans(dense)
    rows = []
    for name, found in others:
        of_found = scans(found)
        for law, criterion in pairs:
            (runs, steps), (all_runs, all_steps) = refined.effort(found, law), refined.effort(dense, law)
            head = [name, law, criterion]
            size = [f"{runs:,}", f"{runs / all_runs:.1%}", f"{steps / all_steps:.1%}"]
            both = [(of_dense[column], of_found[column]) for column in columns if column[:2] == (law, criterion)]
            for edge in EDGES:
                rows.append([*head, edge, *size, *_edge(both, edge), *_exponents(dense, found, law, criterion, edge)])
            rows.append([*head, "pass fraction", *size, *_shares(both), "", "", ""])
    runs = refined.effort(dense)[0]
    note = (
        f"Compared with {dense_name}, {runs:,} runs. Bands and standard errors of an edge: by the gaps between the "
        "failing cells next to it in the dense scan; two scans that differ in their jitter alone are √2 of them apart, "
        f"which is allowed for. Pass fractions: in {BINS} bins over the logarithm of the steps, without those in which "
        "every cell of both passes, or every one fails. Steps: as asked, before early ends and skipped flights."
    )
    return rendered(title, _REFINED, rows, note)


def _edge(both: list[tuple[Scan, Scan]], edge: str) -> list[str]:
    """Return how many edges are compared, are equal and lie within the band, and how far apart they are."""
    apart, errors, equal, within = [], [], 0, 0
    for dense, other in both:
        ours, theirs = dense.edges[edge], other.edges[edge]
        if np.isnan(ours) and np.isnan(theirs):
            continue
        limits = refined.band(dense, edge)
        equal += ours == theirs
        within += limits.low <= theirs <= limits.high
        apart.append(abs(theirs / ours - 1))
        errors.append(abs(np.log(theirs / ours)) / (np.sqrt(2) * limits.error))
    return _told(apart, errors, int(equal), int(within))


def _shares(both: list[tuple[Scan, Scan]]) -> list[str]:
    """Return the same of pass fractions in bins, their differences in hundredths of all members."""
    apart, errors = [np.zeros(0)], [np.zeros(0)]
    for dense, other in both:
        ends = refined.bins(dense, other)
        (ours, error), (theirs, other_error) = (refined.binned(scan, ends) for scan in (dense, other))
        together = np.hypot(error, other_error)
        clear = (together == 0) & (ours == theirs)
        apart.append(np.abs(theirs - ours)[~clear])
        errors.append(apart[-1] / np.maximum(together[~clear], 1e-12))
    differences, in_errors = np.concatenate(apart), np.concatenate(errors)
    equal, within = int((differences == 0).sum()), int((in_errors <= refined.WIDTH).sum())
    return _told(list(differences), list(in_errors), equal, within)


def _told(apart: list[float], errors: list[float], equal: int, within: int) -> list[str]:
    if not apart:
        return ["0", "", "", "", "", ""]
    whole = len(apart)
    largest = [f"{np.median(apart):.2%}", f"{np.max(apart):.2%}", f"{np.max(errors):.1f}"]
    return [str(whole), str(equal), f"{within / whole:.1%}", *largest]


def _exponents(dense: xr.Dataset, found: xr.Dataset, law: str, criterion: str, edge: str) -> list[str]:
    """Return both exponents of the power law through an edge, and how far apart they are in standard errors."""
    fits = []
    for data in (found, dense):
        contact = data.contact.values.tolist().index(meanings_of(data.contact).index(law))
        place = contact, meanings_of(data.criterion).index(criterion), list(EDGES).index(edge)
        fits.append((float(data.exponent.values[place]), float(data.exponent_error.values[place])))
    if not np.isfinite(fits).all():
        return ["", "", ""]
    (theirs, error), (ours, our_error) = fits
    apart = abs(ours - theirs) / max(np.hypot(our_error, error), 1e-12)
    return [*(f"{exponent:.4f} ± {off:.4f}" for exponent, off in fits), f"{apart:.1f}"]
