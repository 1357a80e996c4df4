"""Figure 13: the steps that a stiffness needs, by criterion and contact law, with the scan that says so."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffdice.dynamics import linear_theory
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.report.number_format import scene_of
from stiffdice.sweep.stability_limits import EDGES, FIT, band

_MODELS = {
    "vertical": "a cube that falls straight",
    "sliding": "a cube that slides",
    "tumbling": "a cube that tumbles",
    "flying": "a cube in flight",
}


def steps_needed(sweeps: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return steps against stiffness above, and the same edges as ωh below, a column for each sweep and contact law."""
    columns = style.by_law(sweeps.values())
    figure = style.new_figure(title, width=4.2 * len(columns) + 0.6, height=7.4)
    panels = figure.subplots(2, len(columns), sharex=True, sharey="row", squeeze=False)
    for (upper, lower), frontier in zip(panels.T, columns, strict=True):
        model = "" if len(sweeps) == 1 else _MODELS.get(frontier.attrs["model"], frontier.attrs["model"]) + ", "
        upper.set_title(model + style.law_of(frontier))
        _steps(upper, frontier)
        _omega_h(lower, frontier)
    notes = max(len(panel.texts) for panel in panels[0])
    top = panels[0, 0].get_ylim()[1] * 10 ** (0.12 * notes)  # room for them above the lines
    panels[0, 0].set(ylim=(None, top), ylabel=f"time steps in {scene_of(columns[0])['duration']:g} s [1]")
    panels[1, 0].set_ylabel(style.OMEGA_H)
    figure.legend(handles=_legend(columns), loc="outside lower center", ncols=3 if len(columns) > 1 else 1)
    return figure


def _steps(panel: Any, frontier: xr.Dataset) -> None:
    stiffness, broken = frontier.stiffness.values, style.broken_criteria(frontier)
    panel.set(xscale="log", yscale="log")
    panel.plot(stiffness, frontier.limit, zorder=4, **style.THEORY)
    notes = []
    for criterion, found in broken.items():
        look = style.CRITERION_LOOKS[criterion]
        first, last = found.first_pass.values, found.last_fail.values
        panel.fill_between(stiffness, first, last, color=look["color"], alpha=0.10, linewidth=0)
        _marks(panel, stiffness, first, last, look)
        fit = {name: float(found[name].isel(edge=list(EDGES).index("last_fail"))) for name in FIT}
        if np.isfinite(fit["exponent"]):
            low, high = band(fit, stiffness)
            panel.fill_between(stiffness, low, high, color=look["color"], alpha=0.25, linewidth=0)
            panel.plot(stiffness, fit["factor"] * stiffness ** fit["exponent"], color=look["color"], linewidth=0.8)
            digits = 3 if fit["exponent_error"] >= 5e-4 else 4
            power = rf"$S^{{\,{fit['exponent']:.{digits}f}\pm{fit['exponent_error']:.{digits}f}}}$"
            notes.append((f"{criterion}: last fail ∝ {power}", look["color"]))
    whole = sorted(set(meanings_of(frontier.criterion)) - set(broken))
    notes += [(f"{name}: every member passes in every cell", style.QUIET) for name in whole]
    for k, (note, color) in enumerate(notes):
        panel.text(0.03, 0.97 - 0.06 * k, note, color=color, transform=panel.transAxes, va="top", fontsize=8)


def _marks(panel: Any, stiffness: Any, first: Any, last: Any, look: Mapping[str, str]) -> None:
    """Draw last fail full and first pass open, the open mark larger, so that neither hides the other."""
    panel.plot(stiffness, last, look["last"], color=look["color"], markersize=3.5, zorder=3)
    panel.plot(stiffness, first, look["first"], color=look["color"], markersize=5.5, markerfacecolor="none", zorder=4)


def _omega_h(panel: Any, frontier: xr.Dataset) -> None:
    """Draw the edges as ωh, over all scanned cells: a dot each, dark where members fail."""
    panel.set(xscale="log", yscale="log", xlabel=style.STIFFNESS)
    scan = frontier.isel(cell=frontier.cell_contact.values == int(frontier.contact))
    failing = 1 - scan.pass_fraction.values.min(axis=0)
    # As a drawing it would be 170 bytes a cell.
    look: dict[str, Any] = {"s": 2.5, "cmap": "Greys", "vmin": -0.15, "vmax": 1.3, "linewidths": 0, "rasterized": True}
    panel.scatter(scan.cell_stiffness, scan.cell_omega_h, c=failing, **look)
    panel.axhline(linear_theory.STABILITY_LIMIT, **style.THEORY)
    scale = frontier.limit.values * linear_theory.STABILITY_LIMIT
    for criterion, found in style.broken_criteria(frontier).items():
        first, last = (scale / found[edge].values for edge in ("first_pass", "last_fail"))
        _marks(panel, frontier.stiffness, first, last, style.CRITERION_LOOKS[criterion])
    style.plain_log_ticks(panel.yaxis)


def _legend(columns: list[xr.Dataset]) -> list[Any]:
    handles: list[Any] = []
    found = {name: part for frontier in columns for name, part in style.broken_criteria(frontier).items()}
    for criterion, part in found.items():
        look = style.CRITERION_LOOKS[criterion]
        words = style.criterion_words(criterion, float(part.tolerance), columns[0].attrs.get("hop_height"))
        open_mark = {"color": look["color"], "markersize": 5.5, "markerfacecolor": "none"}
        handles.append(style.mark(f"first pass: {words}", look["first"], **open_mark))
        handles.append(style.mark(f"last fail: {words}", look["last"], color=look["color"], markersize=4))
    handles.append(style.line("theory: ωh = 2", **style.THEORY))
    return [*handles, style.area("scanned cell, darker: more fail", style.QUIET)]
