"""Where stability begins: edges of each criterion over the scanned steps, and the power law through them.

Passing is not monotone in the number of steps, so there is no one limit, and bisection would find an arbitrary one.
What is reported is the scan itself and its two edges.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice import __version__
from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.code_digest import code_digest
from stiffdice.io import schema
from stiffdice.io.cf_enums import meanings_of
from stiffdice.scene import scene as scenes
from stiffdice.scene.flat_landing import CONTACT_LAWS

# What a scan has edges of, and the numbers of a power law through an edge (`io.schema`).
EDGES = ("first_pass", "last_fail", "steps_needed")
FIT = ("exponent", "exponent_error", "factor", "scatter", "centre", "points")

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
    """Return the power law steps = factor · stiffness^exponent through points, and how sure it is.

    Least squares in the logarithms (base 10), over the points that are there: `exponent` and its standard error,
    `factor`, `scatter` (standard deviation of the residuals), `centre` (geometric mean of the stiffnesses) and
    `points`. NaN with fewer than three points.
    """
    points = [(math.log10(x), math.log10(y)) for x, y in zip(stiffness, steps, strict=True) if np.isfinite(y)]
    count = len(points)
    if count < 3:
        return dict.fromkeys(FIT, np.nan) | {"points": float(count)}
    # Sums that are exact, and logarithms one by one: NumPy's own differ in the last digit from processor to processor.
    centre, middle = (math.fsum(values) / count for values in zip(*points, strict=True))
    spread = math.fsum((x - centre) ** 2 for x, _ in points)
    slope = math.fsum((x - centre) * y for x, y in points) / spread
    scatter = math.sqrt(math.fsum((y - middle - slope * (x - centre)) ** 2 for x, y in points) / (count - 2))
    return {
        "exponent": slope,
        "exponent_error": scatter / math.sqrt(spread),
        "factor": 10 ** (middle - slope * centre),
        "scatter": scatter,
        "centre": 10**centre,
        "points": float(count),
    }


def band(fit: Mapping[str, float], stiffness: Values) -> tuple[Values, Values]:
    """Return the steps between which a further edge would lie by two standard errors, shape of `stiffness` each.

    The textbook's prediction band of a regression line: scatter·√(1 + 1/n + (x − x̄)²/Σ(x − x̄)²) in the logarithm. The
    band of the line itself is narrower, and leaves points out wherever the edges are no exact power law.
    """
    away = np.log10(stiffness / fit["centre"])
    width = 2 * np.sqrt(fit["scatter"] ** 2 * (1 + 1 / fit["points"]) + (fit["exponent_error"] * away) ** 2)
    middle = np.log10(fit["factor"]) + fit["exponent"] * np.log10(stiffness)
    return 10 ** (middle - width), 10 ** (middle + width)


def confidence(passing: npt.NDArray[np.int64], members: int) -> tuple[Values, Values]:
    """Return Wilson's 95 % interval of a share of which `passing` of `members` passed, shape of `passing` each.

    Wilson (1927), doi:10.1080/01621459.1927.10502953. It takes members for random draws; ours are spread evenly, so
    that the interval is rather too wide.
    """
    z = 1.959963984540054
    share = passing / members
    middle = (share + z * z / (2 * members)) / (1 + z * z / members)
    width = z * np.sqrt(share * (1 - share) / members + z * z / (4 * members**2)) / (1 + z * z / members)
    # Round-off must not leave the share itself outside.
    return np.clip(middle - width, 0.0, share), np.clip(middle + width, share, 1.0)


def scans(
    contact: npt.NDArray[np.int8], stiffness: Values, steps: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.int8], Values, list[npt.NDArray[np.int64]]]:
    """Return the contact laws and stiffnesses of some cells, ascending, and the numbers of the cells of each column.

    Columns are in the order of contact law and stiffness, the cells of each in that of steps.
    """
    laws, law_of = np.unique(contact, return_inverse=True)
    stiffnesses, stiffness_of = np.unique(stiffness, return_inverse=True)
    column = law_of * len(stiffnesses) + stiffness_of
    order = np.lexsort([steps, column])
    return laws, stiffnesses, np.split(order, np.searchsorted(column[order], range(1, len(laws) * len(stiffnesses))))


def find(sweep: xr.Dataset) -> xr.Dataset:
    """Return the frontier of a collected sweep by contact law, criterion and stiffness; and the scan, by cell."""
    steps, passes = sweep.steps.values, sweep.failing.values == 0
    laws, stiffnesses, cells = scans(sweep.contact.values, sweep.stiffness.values, steps)

    def by_column(values: Sequence[Any]) -> npt.NDArray[Any]:
        """values: shape (criterion, column)."""
        return np.array(values).reshape(len(passes), len(laws), len(stiffnesses)).swapaxes(0, 1)

    of_scans = [[edges(steps[scan], row[scan]) for scan in cells] for row in passes]
    found = {name: by_column([[part[name] for part in row] for row in of_scans]) for name in (*EDGES, "flips")}
    first, last = (by_column(passes[:, [scan[end] for scan in cells]]) for end in (0, -1))
    # An edge at the end of its scan is only a bound; a fit would take it for a measurement.
    measured = zip(EDGES, (~first, last, last), strict=True)
    rows = np.stack([np.where(inside, found[edge], np.nan) for edge, inside in measured], axis=2)
    fits = np.apply_along_axis(lambda row: list(power_law(stiffnesses, row).values()), -1, rows)
    return _dataset(sweep, laws, stiffnesses, found | dict(zip(FIT, np.moveaxis(fits, -1, 0), strict=True)))


def _dataset(
    sweep: xr.Dataset, laws: npt.NDArray[np.int8], stiffnesses: Values, found: Mapping[str, Values]
) -> xr.Dataset:
    scene = scenes.from_mapping(json.loads(sweep.attrs["scene"]))
    limits = [
        linear_theory.steps_for(scene.with_ground(stiffness=value), linear_theory.STABILITY_LIMIT)
        for value in stiffnesses
    ]
    members = int(sweep.attrs["members"])
    passing = members - sweep.failing.values.astype(np.int64)
    low, high = confidence(passing, members)
    values: dict[str, Any] = {
        **{name: found[name] for name in (*EDGES, "flips")},
        "limit": limits,
        "pass_fraction": passing / members,
        "pass_fraction_low": low,
        "pass_fraction_high": high,
        "tolerance": sweep.tolerance.values,
        **{name: found[name] for name in FIT},
        "contact": laws,
        "criterion": sweep.criterion.values,
        "edge": np.arange(len(EDGES), dtype=np.int8),
        "stiffness": stiffnesses,
        **{f"cell_{name}": sweep[name].values for name in ("contact", "stiffness", "steps", "omega_h")},
    }
    names = {"criterion": meanings_of(sweep.criterion), "edge": EDGES}
    meanings = names | {key: list(CONTACT_LAWS) for key in ("contact", "cell_contact")}
    attributes = sweep.attrs | {
        "title": "Edges of stability",
        "kind": "frontier",
        "stiffdice_version": __version__,
        "analysis_code_digest": code_digest("stiffdice.sweep.stability_limits"),
    }
    return schema.dataset("frontier", values, meanings, attributes)


def table(frontier: xr.Dataset) -> str:
    """Return the frontier as CSV: one line for each contact law, criterion and stiffness."""
    laws, criteria = meanings_of(frontier.contact), meanings_of(frontier.criterion)
    edge, columns = meanings_of(frontier.edge).index("last_fail"), (*EDGES, "flips")
    head = ("contact", "criterion", "tolerance", "stiffness_kg_s-2", "limit_omega_h_2")
    lines = [",".join([*head, *columns, "last_fail_exponent", "last_fail_exponent_error"])]
    for k, c, s in np.ndindex(*frontier.first_pass.shape):
        where = f"{laws[frontier.contact.values[k]]},{criteria[c]},{frontier.tolerance.values[c]:g}"
        numbers = [frontier[name].values[k, c, s] for name in columns]
        shown = ["" if np.isnan(number) else f"{number:.0f}" for number in numbers]
        fit = [f"{frontier[name].values[k, c, edge]:.4f}" for name in ("exponent", "exponent_error")]
        at = f"{frontier.stiffness.values[s]:.6g},{frontier.limit.values[s]:.1f}"
        lines.append(",".join([where, at, *shown, *fit]))
    return "\n".join(lines) + "\n"
