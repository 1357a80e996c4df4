"""Figure 13 asked again: what an accuracy costs against stiffness, one line per method, with the √S law beside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from stiffdice.experiments.work_precision.problems import PROBLEMS
from stiffdice.report.figures import effort_ladder, style
from stiffdice.report.tables.work_precision import ERRORS, Found, found_in

_SAY = {1e-2: "1 %", 1e-3: "10⁻³", 1e-6: "10⁻⁶"}


def position(data: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return a panel for each problem and error of the position; data: experiments `work-precision`, and timings."""
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
    panels = figure.subplots(len(rows), len(ERRORS), sharex=True, sharey="row", squeeze=False)
    for line, found in zip(panels, rows, strict=True):
        for panel, bound in zip(line, ERRORS, strict=True):
            _panel(panel, found, measure, bound)
            panel.set_title(f"{PROBLEMS[found.problem].name}, {measure} to {_SAY[bound]}")
        line[0].set_ylabel("force evaluations [1]" if found.seconds is None else "wall time [s]")
    for panel in panels[-1]:
        panel.set_xlabel("stiffness S [kg/s²]")
    figure.legend(handles=_legend(rows), loc="outside lower center", ncols=6)
    return figure


def _panel(panel: Any, found: Found, measure: str, bound: float) -> None:
    stiffness = found.data.stiffness.values
    panel.set(xscale="log", yscale="log")
    for method in found.methods:
        look = effort_ladder.look(method)
        costs = [found.cost(method, i, measure, bound, timed=found.seconds is not None) for i in range(len(stiffness))]
        values, tried = np.array([cost.value for cost in costs]), np.array([cost.tried for cost in costs])
        reached = np.array([cost.reached for cost in costs])
        panel.plot(stiffness, values, label=method, **look | {"marker": ""})
        panel.plot(stiffness[reached], values[reached], **look | {"linestyle": "none"})
        panel.plot(stiffness[~reached], values[~reached], **look | {"linestyle": "none", "markerfacecolor": "none"})
        beyond = np.isnan(values)
        panel.plot(stiffness[beyond], tried[beyond], **look | _MORE)
        if method == _LAW_OF and np.isfinite(values).any():
            k = int(np.flatnonzero(np.isfinite(values))[0])
            law = values[k] * np.sqrt(stiffness / stiffness[k])
            panel.plot(stiffness, law, color=style.INK, linestyle=":", linewidth=1.0, zorder=1)


# The scheme whose cost the √S law is drawn through, at the softest ground.
_LAW_OF = "symplectic_euler"

_MORE: dict[str, Any] = {"linestyle": "none", "marker": r"$\uparrow$", "markersize": 9}


def _legend(rows: list[Found]) -> list[Any]:
    names = list(dict.fromkeys(name for found in rows for name in found.methods))
    lines: list[Any] = list(effort_ladder.handles(names))
    lines.append(Line2D([], [], color=style.INK, linestyle=":", linewidth=1.0, label="the paper's law: ∝ √S"))
    hollow: Any = {"linestyle": "none", "marker": "o", "markersize": 4, "markerfacecolor": "none", "color": style.QUIET}
    lines.append(Line2D([], [], label="hollow: ladder continued", **hollow))
    lines.append(Line2D([], [], label="more than this, tried in vain", color=style.QUIET, **_MORE))
    return lines
