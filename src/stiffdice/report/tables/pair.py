"""Tables of two cubes that meet: limits of the steps, how the cubes leave each other, orders of the schemes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from stiffdice.io.cf_enums import meanings_of
from stiffdice.report import pair_words
from stiffdice.report.markdown_table import Table, rendered
from stiffdice.report.number_format import readable, scene_of

_STRETCHES = {
    "held": "within one contact",
    "touch": "across the touch",
    "handed": "across contacts handed over",
    "motion": "two meetings, from before to after",
}
# Offsets and frictions that are told, as far as measured.
_OFFSETS, _FRICTIONS = (0.1, 0.3, 0.5, 0.7, 0.9, 1.1), (0.0, 0.2, 1.0)


def limits(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each case: the mode, the slope, and ωh of its edges and of the predictions."""
    rows = []
    for name, found in pair_words.cases_of(experiments).items():
        k = float(found.mode_number[0])
        ends = [_span(found, edge) for edge in ("first_pass", "steps_needed", "last_fail")]
        predicted = [_span(found, edge) for edge in ("limit", "gain", "bound")]
        slope = f"{float(found.exponent):.3f} ± {float(found.exponent_error):.3f}"
        rows.append([pair_words.CASES[name], f"{k:.4g}", slope, *ends, *predicted])
    columns = [
        "case",
        "ω² m/S",
        "slope",
        "first pass",
        "all pass from",
        "last fail",
        "linear limit",
        "no gain",
        "bound",
    ]
    note = "All but the first three: ωh, from the smallest to the largest over the stiffnesses."
    return rendered(title, columns, rows, note)


def _span(found: xr.Dataset, edge: str) -> str:
    """Return the ωh at which an edge lies, over the stiffnesses."""
    scene = scene_of(found)
    omega = np.sqrt(found.mode_number.values * found.stiffness.values / scene["cube"]["mass"])
    values = omega * scene["duration"] / found[edge].values
    if np.isnan(values).all():
        return ""
    low, high = np.nanmin(values), np.nanmax(values)
    return f"{low:.3g}" if high - low < 1e-6 * high else f"{low:.2f} … {high:.2f}"


def outcomes(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each pose, restitution, friction and offset that is told."""
    (found,) = experiments.values()
    scale, speed = pair_words.spin_of_units(found), float(found.attrs["speed"])
    told = [int(np.abs(found.offset.values - value).argmin()) for value in _OFFSETS]
    rows = []
    for p, pose in enumerate(meanings_of(found.pose)):
        for e, mu, k in np.ndindex(found.sizes["restitution"], found.sizes["friction"], len(told)):
            there = found.isel(pose=p, restitution=e, friction=mu, offset=told[k])
            if float(there.friction) in _FRICTIONS:
                numbers = [float(there[axis]) for axis in ("restitution", "friction", "offset")]
                velocity = [part for body in there.velocity.values / speed for part in body[:2]]
                left = [*(there.spin.values / scale), *velocity, float(there.energy.sum())]
                cells = [f"{part:.3f}".replace("-", "−") for part in left]
                error = readable(float(there.spin_error) / scale, 1)
                rows.append([pair_words.POSES[pose], *(f"{part:.3g}" for part in numbers), *cells, error])
    columns = ["pose", "e", "μ", "offset", "ω moving", "ω struck", "u_x moving", "u_y", "u_x struck", "u_y", "energy"]
    note = (
        "Offset in sides; angular velocities ω in speed over side, velocities u over that of the launch, along it (x), "
        "and towards the struck cube's side (y); energy of both over that of the launch; error: of ω, by half the step."
    )
    return rendered(title, [*columns, "error"], rows, note)


def orders(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each stretch and damping: the order of each scheme, and its error at the most steps."""
    (found,) = experiments.values()
    methods = meanings_of(found.method)
    rows = []
    for s, stretch in enumerate(meanings_of(found.stretch)):
        for d, damping in enumerate(found.damping.values):
            there = found.isel(stretch=s, damping=d)
            cells = [
                f"{float(there.order[k]):.2f} ({readable(float(there.error[k, -1]), 2)})" for k in range(len(methods))
            ]
            rows.append([_STRETCHES[stretch], f"{damping:g}", *cells])
    steps = int(found.step_count.values[-1])
    note = f"Observed order, and in brackets the largest error over the side at {steps:,} steps in the stretch."
    return rendered(title, ["stretch", "D [kg/s]", *(name.replace("_", " ") for name in methods)], rows, note)
