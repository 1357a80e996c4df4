"""Where stability begins: edges of each criterion over the scanned steps, and the power law through them.

Passing is not monotone in the number of steps, so there is no one limit, and bisection would find an arbitrary one.
What is reported is the scan itself and its two edges.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice import __version__, theory
from stiffdice import scene as scenes
from stiffdice.io import layout
from stiffdice.io.enums import enum_attributes, meanings_of
from stiffdice.provenance import code_digest
from stiffdice.verdict import Verdict, criteria_of

# What a scan has edges of, and what they are.
EDGES = {
    "first_pass": "fewest steps at which every member passes",
    "last_fail": "most steps at which a member still fails",
    "steps_needed": "fewest scanned steps from which on every member passes",
}

Values = npt.NDArray[np.float64]


def edges(steps: npt.NDArray[np.int64], passes: npt.NDArray[np.bool_]) -> dict[str, float]:
    """Return first_pass, last_fail, steps_needed and flips of one scan; NaN where the scan has no such point.

    steps: ascending, shape (scan,). passes: whether all members passed, same shape.
    """
    good, bad = np.flatnonzero(passes), np.flatnonzero(~passes)
    above = bad[-1] + 1 if bad.size else None
    return {
        "first_pass": float(steps[good[0]]) if good.size else np.nan,
        "last_fail": float(steps[bad[-1]]) if bad.size else np.nan,
        "steps_needed": float(steps[above]) if above is not None and above < len(steps) else np.nan,
        "flips": float(np.count_nonzero(passes[1:] != passes[:-1])),
    }


def power_law(stiffness: Values, steps: Values) -> dict[str, float]:
    """Return exponent, its standard error and the factor of steps = factor · stiffness^exponent.

    Least squares in the logarithms, over the points that are there; NaN with fewer than three of them.
    """
    known = np.isfinite(steps)
    if np.count_nonzero(known) < 3:
        return {"exponent": np.nan, "exponent_error": np.nan, "factor": np.nan}
    x, y = np.log10(stiffness[known]), np.log10(steps[known])
    centred = x - x.mean()
    slope = float(centred @ y / (centred @ centred))
    residual = y - y.mean() - slope * centred
    error = float(np.sqrt(residual @ residual / (len(x) - 2) / (centred @ centred)))
    return {"exponent": slope, "exponent_error": error, "factor": float(10 ** (y.mean() - slope * x.mean()))}


def find(sweep: xr.Dataset, tolerances: Mapping[str, float]) -> xr.Dataset:
    """Return the frontier of a collected sweep: dimensions contact, criterion, stiffness; and the scan, dimension cell.

    tolerances: by criterion; the others keep their defaults.
    """
    criteria = criteria_of(sweep.attrs["model"])
    used = {name: tolerances.get(name, criterion.tolerance) for name, criterion in criteria.items()}
    finite = sweep.verdict.values != Verdict.LEFT_NUMERIC_RANGE
    holds = np.stack([finite & part.holds(sweep[part.measure].values, used[name]) for name, part in criteria.items()])
    laws, stiffnesses = np.unique(sweep.contact.values), np.unique(sweep.stiffness.values)
    shape = (len(laws), len(criteria), len(stiffnesses))
    found = {name: np.full(shape, np.nan) for name in (*EDGES, "flips")}
    fits = {name: np.full((*shape[:2], len(EDGES)), np.nan) for name in ("exponent", "exponent_error", "factor")}
    passes = np.asarray(holds.all(axis=-1))
    for k, law in enumerate(laws):
        for c in range(len(criteria)):
            inside = np.zeros((len(EDGES), len(stiffnesses)), bool)
            for s, stiffness in enumerate(stiffnesses):
                scan = (sweep.contact.values == law) & (sweep.stiffness.values == stiffness)
                row = passes[c, scan]
                for name, value in edges(sweep.steps.values[scan], row).items():
                    found[name][k, c, s] = value
                inside[:, s] = not row[0], row[-1], row[-1]
            for e, edge in enumerate(EDGES):
                # An edge at the end of its scan is only a bound; a fit would take it for a measurement.
                measured = np.where(inside[e], found[edge][k, c], np.nan)
                for name, value in power_law(stiffnesses, measured).items():
                    fits[name][k, c, e] = value
    return _dataset(sweep, laws, stiffnesses, used, found, fits, 1 - holds.mean(axis=-1))


def _dataset(
    sweep: xr.Dataset,
    laws: npt.NDArray[np.int8],
    stiffnesses: Values,
    tolerances: Mapping[str, float],
    found: Mapping[str, Values],
    fits: Mapping[str, Values],
    failing: Values,
) -> xr.Dataset:
    grid = ("contact", "criterion", "stiffness")
    per_edge = ("contact", "criterion", "edge")
    scene = scenes.from_mapping(json.loads(sweep.attrs["scene"]))
    limits = [theory.steps_for(scene.with_ground(stiffness=value), theory.STABILITY_LIMIT) for value in stiffnesses]
    variables: dict[str, Any] = {
        name: (grid, found[name], {"long_name": meaning, "units": "1"}) for name, meaning in EDGES.items()
    }
    variables |= {
        "flips": (
            grid,
            found["flips"],
            {"long_name": "changes between pass and fail along the scan", "units": "1"},
        ),
        "limit": (
            "stiffness",
            limits,
            {"long_name": "steps at the linear stability limit, omega h = 2", "units": "1"},
        ),
        "failing": (
            ("criterion", "cell"),
            failing,
            {"long_name": "share of a cell's members that fail the criterion", "units": "1"},
        ),
        "tolerance": (
            "criterion",
            list(tolerances.values()),
            {"long_name": "tolerance of the criterion", "units": "1"},
        ),
        "exponent": (per_edge, fits["exponent"], {"long_name": "exponent of the power law", "units": "1"}),
        "exponent_error": (
            per_edge,
            fits["exponent_error"],
            {"long_name": "standard error of it", "units": "1"},
        ),
        "factor": (
            per_edge,
            fits["factor"],
            {"long_name": "steps at stiffness 1 kg s-2 by the power law", "units": "1"},
        ),
    }
    coordinates: dict[str, Any] = {
        "contact": ("contact", laws, layout.CONTACT_ATTRIBUTES),
        "criterion": (
            "criterion",
            np.arange(len(tolerances), dtype=np.int8),
            enum_attributes("criterion", list(tolerances)),
        ),
        "edge": ("edge", np.arange(len(EDGES), dtype=np.int8), enum_attributes("edge of a criterion", list(EDGES))),
        "stiffness": ("stiffness", stiffnesses, {"long_name": "ground stiffness", "units": "kg s-2"}),
    }
    coordinates |= {
        f"cell_{name}": ("cell", sweep[name].values, sweep[name].attrs)
        for name in ("contact", "stiffness", "steps", "omega_h")
    }
    attributes = {key: value for key, value in sweep.attrs.items() if key != "verdict_criteria"} | {
        "title": "Edges of stability",
        "stiffdice_version": __version__,
        "members": sweep.sizes["member"],
        "analysis_code_digest": code_digest("stiffdice.frontier"),
    }
    return xr.Dataset(variables, coordinates, attributes)


def table(frontier: xr.Dataset) -> str:
    """Return the frontier as CSV: one line for each contact law, criterion and stiffness."""
    laws = meanings_of(frontier.contact)
    criteria = meanings_of(frontier.criterion)
    columns = ("first_pass", "last_fail", "steps_needed", "flips")
    lines = [
        "contact,criterion,tolerance,stiffness_kg_s-2,limit_omega_h_2,"
        + ",".join(columns)
        + ",last_fail_exponent,last_fail_exponent_error"
    ]
    edge = meanings_of(frontier.edge).index("last_fail")
    for k, law in enumerate(frontier.contact.values):
        for c, criterion in enumerate(criteria):
            fit = [f"{frontier[name].values[k, c, edge]:.4f}" for name in ("exponent", "exponent_error")]
            for s, stiffness in enumerate(frontier.stiffness.values):
                numbers = [frontier[name].values[k, c, s] for name in columns]
                shown = ["" if np.isnan(number) else f"{number:.0f}" for number in numbers]
                start = [laws[law], criterion, f"{frontier.tolerance.values[c]:g}", f"{stiffness:.6g}"]
                lines.append(",".join([*start, f"{frontier.limit.values[s]:.1f}", *shown, *fit]))
    return "\n".join(lines) + "\n"
