"""Figure 13: the steps that a stiffness needs, by two criteria and two contact laws, with the scan that says so."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stiffdice import theory
from stiffdice.figures import style

_LOOKS = {
    "energy": {"color": style.BLUE, "first": "v", "last": "^"},
    "apex": {"color": style.VERMILION, "first": "s", "last": "D"},
}
_SAY = {
    "energy": "airborne energy ≤ {limit:g} E₀",
    "apex": "apex ≤ {limit:g} × the one before",
}
_LAWS = {"ungated": "as listed (ungated)", "gated": "as written (gated)"}


def steps_needed(frontier: xr.Dataset, sweep: xr.Dataset, title: str) -> Figure:
    """Return steps against stiffness above, and the same edges as ωh below, a column for each contact law."""
    laws = [frontier.contact.attrs["flag_meanings"].split()[k] for k in frontier.contact.values]
    figure = style.new_figure(title, width=4.2 * len(laws) + 0.6, height=7.0)
    panels = figure.subplots(2, len(laws), sharex=True, sharey="row", squeeze=False)
    for column, law in enumerate(laws):
        upper, lower = panels[:, column]
        upper.set_title(_LAWS[law])
        _steps(upper, frontier.isel(contact=column))
        _omega_h(lower, frontier.isel(contact=column), sweep)
        lower.set_xlabel("stiffness S [kg/s²]")
    duration = json.loads(sweep.attrs["scene"])["duration"]
    panels[0, 0].set_ylabel(f"time steps in {duration:g} s [1]")
    panels[1, 0].set_ylabel("ωh of a flat landing [1]")
    figure.legend(handles=_legend(frontier), loc="outside lower center", ncols=3)
    return figure


def _criteria(frontier: xr.Dataset) -> list[str]:
    return list(frontier.criterion.attrs["flag_meanings"].split())


def _steps(panel: Any, frontier: xr.Dataset) -> None:
    stiffness = frontier.stiffness.values
    panel.set(xscale="log", yscale="log")
    panel.plot(stiffness, frontier.limit, color=style.INK, linestyle="--", linewidth=1.0, zorder=4)
    notes = []
    for c, criterion in enumerate(_criteria(frontier)):
        look = _LOOKS[criterion]
        first, last = frontier.first_pass.values[c], frontier.last_fail.values[c]
        panel.fill_between(stiffness, first, last, color=look["color"], alpha=0.15, linewidth=0)
        panel.plot(stiffness, first, look["first"], color=look["color"], markersize=3.5, markerfacecolor="white")
        panel.plot(stiffness, last, look["last"], color=look["color"], markersize=3.5)
        exponent, error, factor = (
            float(frontier[name].values[c, 1]) for name in ("exponent", "exponent_error", "factor")
        )
        if np.isfinite(exponent):
            panel.plot(stiffness, factor * stiffness**exponent, color=look["color"], linewidth=0.8)
            power = rf"$S^{{\,{exponent:.3f}\pm{error:.3f}}}$"
            notes.append((f"{criterion}: last fail ∝ {power}", look["color"]))
    for k, (note, color) in enumerate(notes):
        panel.text(0.03, 0.95 - 0.065 * k, note, color=color, transform=panel.transAxes, va="top", fontsize=8)


def _omega_h(panel: Any, frontier: xr.Dataset, sweep: xr.Dataset) -> None:
    """Draw the edges as ωh, over all scanned cells: a dot each, dark where members fail."""
    panel.set(xscale="log", yscale="log")
    scan = sweep.isel(cell=sweep.contact.values == int(frontier.contact))
    share = (scan.verdict.values != 0).mean(axis=1)
    panel.scatter(scan.stiffness, scan.omega_h, c=share, s=2.5, cmap="Greys", vmin=-0.15, vmax=1.3, linewidths=0)
    panel.axhline(theory.STABILITY_LIMIT, color=style.INK, linestyle="--", linewidth=1.0)
    scale = frontier.limit.values * theory.STABILITY_LIMIT
    for c, criterion in enumerate(_criteria(frontier)):
        look = _LOOKS[criterion]
        for edge, marker in (("first_pass", "first"), ("last_fail", "last")):
            fill = "white" if marker == "first" else look["color"]
            panel.plot(
                frontier.stiffness,
                scale / frontier[edge].values[c],
                look[marker],
                color=look["color"],
                markersize=3.5,
                markerfacecolor=fill,
            )
    panel.set_yticks([0.1, 0.2, 0.5, 1, 2], ["0.1", "0.2", "0.5", "1", "2"])
    panel.minorticks_off()


def _legend(frontier: xr.Dataset) -> list[Any]:
    handles: list[Any] = []
    for c, criterion in enumerate(_criteria(frontier)):
        look, limit = _LOOKS[criterion], 1 + float(frontier.tolerance[c])
        words = _SAY[criterion].format(limit=limit)
        common: Any = {"linestyle": "none", "color": look["color"], "markersize": 4}
        handles.append(Line2D([], [], marker=look["last"], label=f"last fail: {words}", **common))
        handles.append(
            Line2D([], [], marker=look["first"], markerfacecolor="white", label=f"first pass: {words}", **common)
        )
    handles.insert(2, Line2D([], [], color=style.INK, linestyle="--", label="theory: ωh = 2"))
    handles.append(Patch(color=style.QUIET, label="scanned cell, darker: more members fail"))
    return handles
