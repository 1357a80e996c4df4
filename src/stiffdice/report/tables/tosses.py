"""Tables of real tosses: the fit, the pieces of the model, where steps begin to matter, and what chaos allows."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.markdown_table import Table, rendered

# Of each variant of the model, for people.
VARIANT_WORDS = {
    "full": "full model",
    "flight_launch": "launch fitted to the flight",
    "lengths_as_stored": "lengths as stored",
    "solid_inertia": "inertia of a solid cube",
    "corner_inertia": "inertia of eight corners",
    "no_friction": "no friction",
    "ungated": "ungated law",
    "no_rotation": "no rotation",
    "no_ground": "no ground",
    "stays": "stays as at the first sample",
}
_SOURCES = {"sample": "first sample", "flight": "fit to the flight"}
_CRITERIA = {"path": "path", "orientation": "orientation", "face": "final face"}


def _mean(values: Array, factor: float) -> str:
    """Return a mean over tosses with its 95 % interval's half, as 14.1 ± 1.4."""
    values = values[np.isfinite(values)]
    if not len(values):
        return "–"
    half = 1.96 * values.std() / math.sqrt(len(values))
    return f"{factor * values.mean():.1f} ± {factor * half:.1f}"


def _errors(found: xr.Dataset) -> list[str]:
    factors = {"path": 100.0, "orientation": 180 / math.pi, "right": 100.0}
    return [_mean(found[name].values, factor) for name, factor in factors.items()]


_COLUMNS = ["path error [% of the side]", "orientation error [°]", "right final faces [%]"]


def fit(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each source of launches and contact time: restitution, friction, and what is left."""
    (found,) = experiments.values()
    rows = []
    for k, source in enumerate(meanings_of(found.source)):
        for time in found.contact_time.values.tolist():
            here = found.isel(source=k).sel(contact_time=time)
            ends = [
                f"{float(here[name]):.3f} ({float(here[f'{name}_low']):.3f} to {float(here[f'{name}_high']):.3f})"
                for name in ("restitution", "friction")
            ]
            rows.append([_SOURCES[source], f"{1e3 * time:g}", *ends, *_errors(here)])
    about = found.attrs
    length, fall = (f"{about[f'unit_{name}']:.4g} ± {about[f'unit_{name}_error']:.1g}" for name in ("length", "fall"))
    told, kept = f"{int(about['fitted'])} random tosses of {int(about['tosses'])}", 100 * float(about["kept_face"])
    note = (
        f"Fitted on {told}, told on the others; 95 % intervals. Lengths are {length} times those of the file, so that "
        f"the cube at rest is half its width high; its flights then fall at {fall} m/s². {kept:.1f} % of the tosses "
        "end on the face that was up at the first sample."
    )
    columns = ["launches", "contact time [ms]", "restitution e", "friction μ", *_COLUMNS]
    return rendered(title, columns, rows, note)


def models(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each variant of the model: errors and right faces."""
    (found,) = experiments.values()
    names = meanings_of(found.variant)
    rows = [[VARIANT_WORDS[name], *_errors(found.isel(variant=k))] for k, name in enumerate(names)]
    about = found.attrs
    note = (
        f"{found.sizes['toss']} tosses that the fit has not seen; e = {about['restitution']:g}, μ = "
        f"{about['friction']:g}, contact time {1e3 * about['contact_time']:g} ms in all rows; 95 % intervals."
    )
    return rendered(title, ["variant", *_COLUMNS], rows, note)


def steps(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each contact time and criterion: the floor, and where a curve leaves it."""
    (found,) = experiments.values()
    factors, rows = {"path": (100.0, "%"), "orientation": (180 / math.pi, "°"), "face": (100.0, "% wrong")}, []
    for time in found.contact_time.values.tolist():
        here = found.sel(contact_time=time)
        for k, criterion in enumerate(meanings_of(found.criterion)):
            factor, unit = factors[criterion]
            left, low, high = (float(here[name][k]) for name in ("left", "left_low", "left_high"))
            per_second = float(here.contact_frequency) / left
            floor = f"{_mean(here.floor.values[k], factor)} {unit}"
            edge = f"{left:.2f} ({low:.2f} to {high:.2f})"
            rows.append([f"{1e3 * time:g}", _CRITERIA[criterion], floor, edge, f"{per_second:.0f}"])
    limit = found.stability_limit.values
    note = (
        f"{found.sizes['toss']} tosses; 95 % intervals. A curve leaves its floor where the error is 5 % more, or 5 % "
        f"fewer faces are right. The fastest contact is linearly unstable from ωh = {limit.min():.2f} on."
    )
    columns = ["contact time [ms]", "criterion", "floor", "ωh where left", "steps a second there"]
    return rendered(title, columns, rows, note)


def chaos(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each source of launches and size of error: faces that change, and how many could be right."""
    (found,) = experiments.values()
    rows = []
    for k, source in enumerate(meanings_of(found.source)):
        for size in found["size"].values.tolist():
            here = found.isel(source=k).sel(size=size)
            shares = [_mean(here[name].values, 100.0) for name in ("changed", "likeliest", "right")]
            some = 100 * float((here.changed > 0.01).mean())
            rows.append([_SOURCES[source], f"{size:g}", *shares, f"{some:.1f}"])
    alone = [f"{100 * float(found.unperturbed[k].mean()):.1f} %" for k in range(found.sizes["source"])]
    note = (
        f"{found.sizes['toss']} tosses, {int(found.attrs['draws'])} draws each; 95 % intervals over tosses. "
        f"Unperturbed, {' and '.join(alone)} are right."
    )
    columns = [
        "launches", "error over the tracker's", "face changed [%]", "right at best [%]", "right [%]",
        "tosses that change at all [%]",
    ]  # fmt: skip
    return rendered(title, columns, rows, note)
