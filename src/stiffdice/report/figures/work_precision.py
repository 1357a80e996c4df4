"""Work and precision: error against force evaluations, or against time where it was measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stiffdice.experiments.work_precision.problems import PROBLEMS
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report import number_format
from stiffdice.report.figures import effort_ladder, style
from stiffdice.report.tables import engine_notes
from stiffdice.report.tables.work_precision import Found, found_in

# So many stiffnesses are drawn at most, from the softest to the stiffest.
_COLUMNS = 3
_ERRORS = {
    "position": "position error, RMS [r]",
    "restitution": "error of the restitution [1]",
    "energy": "error of the energy at the end [E₀]",
}
# Errors above are drawn at the upper edge: such a run has nothing to do with the reference any more.
_WORST = 10.0


def position(data: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return a panel for each problem and some stiffnesses; data: experiments `work-precision`, and timings of them."""
    return _drawn(data, title, "position")


def restitution(data: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the same for the restitution of the first landing."""
    return _drawn(data, title, "restitution")


def energy(data: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the same for the energy at the end."""
    return _drawn(data, title, "energy")


def _drawn(data: Mapping[str, xr.Dataset], title: str, measure: str) -> Figure:
    rows = found_in(data.values())
    figure = style.new_figure(title, width=12.0, height=3.1 * len(rows) + 1.4)
    columns = min(_COLUMNS, max(found.data.sizes["stiffness"] for found in rows))
    panels = figure.subplots(len(rows), columns, sharex="row", sharey="row", squeeze=False)
    for line, found in zip(panels, rows, strict=True):
        shown = np.linspace(0, found.data.sizes["stiffness"] - 1, columns).round().astype(int)
        for panel, stiffness in zip(line, shown, strict=True):
            _panel(panel, found, int(stiffness), measure)
        line[0].set_ylabel(_ERRORS[measure])
    told = engine_notes.line(found.data for found in rows)
    words: dict[str, Any] = {"title": told, "title_fontsize": 7.5} if told else {}
    figure.legend(handles=_legend(rows), loc="outside lower center", ncols=6, **words)
    return figure


def _panel(panel: Any, found: Found, stiffness: int, measure: str) -> None:
    data = found.data.isel(stiffness=stiffness)
    timed = found.seconds is not None
    costs = found.data.evaluations.values if found.seconds is None else found.seconds
    panel.set(xscale="log", yscale="log")
    for k, method in enumerate(found.methods):
        errors, x = data[f"{measure}_error"].values[k], costs[stiffness, k]
        drawn = (data.evaluations.values[k] > 0) & np.isfinite(x)
        kept = np.clip(np.where(np.isnan(errors), np.inf, errors), _lowest(data, measure), _WORST)
        look = effort_ladder.look(method)
        panel.plot(x[drawn], kept[drawn], markevery=0, label=method, **look | {"marker": ""})
        measured = drawn if found.itself is None else drawn & found.itself[stiffness, k]
        panel.plot(x[measured], kept[measured], **look | {"linestyle": "none"})
        hollow = {"linestyle": "none", "markerfacecolor": "none"}
        panel.plot(x[drawn & ~measured], kept[drawn & ~measured], **look | hollow)
    low, high = _floor(data, measure)
    panel.axhspan(low, high, color=style.QUIET, alpha=0.25, linewidth=0)
    panel.axhline(low, color=style.QUIET, linewidth=0.8)
    panel.set_ylim(_lowest(data, measure) / 2, 2 * _WORST)
    ground = f"S = {number_format.readable(float(data.stiffness))} kg/s²"
    panel.set_title(f"{PROBLEMS[found.problem].name}, {ground}")
    panel.set_xlabel("median wall time [s]" if timed else "force evaluations [1]")


def _floor(data: xr.Dataset, measure: str) -> tuple[float, float]:
    low, high = data.floor.values[:, meanings_of(data.measure).index(measure)]
    return float(low), float(high)


def _lowest(data: xr.Dataset, measure: str) -> float:
    """Return where errors of nothing are drawn: a tenth of the floor, or the least error found."""
    errors = data[f"{measure}_error"].values
    return float(np.min(errors[errors > 0], initial=_floor(data, measure)[0])) / 10


def _legend(rows: list[Found]) -> list[Any]:
    names = list(dict.fromkeys(name for found in rows for name in found.methods))
    lines: list[Any] = list(effort_ladder.handles(names))
    lines.append(Patch(color=style.QUIET, alpha=0.25, label="round-off: in the launch (line) … in a contact's depth"))
    if any(found.seconds is not None for found in rows):
        hollow: Any = {"linestyle": "none", "marker": "o", "markerfacecolor": "none", "color": style.QUIET}
        lines.append(Line2D([], [], label="hollow: time per step × steps", **hollow))
    return lines
