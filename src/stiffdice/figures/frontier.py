"""Figure 13: the steps that a stiffness needs, by two criteria and two contact laws, with the scan that says so."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullLocator

from stiffdice import theory
from stiffdice.figures import style
from stiffdice.io.enums import meanings_of

# One look for each criterion, in their order.
_LOOKS = (
    {"color": style.BLUE, "first": "v", "last": "^"},
    {"color": style.VERMILION, "first": "s", "last": "D"},
    {"color": style.GREEN, "first": "o", "last": "p"},
)
_SAY = {
    "energy": "airborne energy ≤ {limit:g} E₀",
    "apex": "apex ≤ {limit:g} × the one before",
}
_LAWS = {"ungated": "as listed (ungated)", "gated": "as written (gated)"}


def steps_needed(frontier: xr.Dataset, title: str) -> Figure:
    """Return steps against stiffness above, and the same edges as ωh below, a column for each contact law."""
    laws = [meanings_of(frontier.contact)[k] for k in frontier.contact.values]
    figure = style.new_figure(title, width=4.2 * len(laws) + 0.6, height=7.0)
    panels = figure.subplots(2, len(laws), sharex=True, sharey="row", squeeze=False)
    for column, law in enumerate(laws):
        upper, lower = panels[:, column]
        upper.set_title(_LAWS[law])
        _steps(upper, frontier.isel(contact=column))
        _omega_h(lower, frontier.isel(contact=column))
        lower.set_xlabel("stiffness S [kg/s²]")
    duration = json.loads(frontier.attrs["scene"])["duration"]
    panels[0, 0].set_ylabel(f"time steps in {duration:g} s [1]")
    panels[1, 0].set_ylabel("ωh of a flat landing [1]")
    figure.legend(handles=_legend(frontier), loc="outside lower center", ncols=3 if len(laws) > 1 else 1)
    return figure


def _steps(panel: Any, frontier: xr.Dataset) -> None:
    stiffness = frontier.stiffness.values
    panel.set(xscale="log", yscale="log")
    panel.plot(stiffness, frontier.limit, color=style.INK, linestyle="--", linewidth=1.0, zorder=4)
    notes = []
    fitted = meanings_of(frontier.edge).index("last_fail")
    for c, criterion in enumerate(meanings_of(frontier.criterion)):
        look = _LOOKS[c % len(_LOOKS)]
        first, last = frontier.first_pass.values[c], frontier.last_fail.values[c]
        panel.fill_between(stiffness, first, last, color=look["color"], alpha=0.15, linewidth=0)
        _marks(panel, stiffness, first, last, look)
        exponent, error, factor = (
            float(frontier[name].values[c, fitted]) for name in ("exponent", "exponent_error", "factor")
        )
        if np.isfinite(exponent):
            panel.plot(stiffness, factor * stiffness**exponent, color=look["color"], linewidth=0.8)
            power = rf"$S^{{\,{exponent:.3f}\pm{error:.3f}}}$"
            notes.append((f"{criterion}: last fail ∝ {power}", look["color"]))
    for k, (note, color) in enumerate(notes):
        panel.text(0.03, 0.95 - 0.065 * k, note, color=color, transform=panel.transAxes, va="top", fontsize=8)


def _marks(panel: Any, stiffness: Any, first: Any, last: Any, look: Mapping[str, str]) -> None:
    """Draw last fail full and first pass open, the open mark larger, so that neither hides the other."""
    panel.plot(stiffness, last, look["last"], color=look["color"], markersize=3.5, zorder=3)
    panel.plot(stiffness, first, look["first"], color=look["color"], markersize=5.5, markerfacecolor="none", zorder=4)


def _omega_h(panel: Any, frontier: xr.Dataset) -> None:
    """Draw the edges as ωh, over all scanned cells: a dot each, dark where members fail."""
    panel.set(xscale="log", yscale="log")
    scan = frontier.isel(cell=frontier.cell_contact.values == int(frontier.contact))
    panel.scatter(
        scan.cell_stiffness,
        scan.cell_omega_h,
        c=scan.failing.values.max(axis=0),
        s=2.5,
        cmap="Greys",
        vmin=-0.15,
        vmax=1.3,
        linewidths=0,
    )
    panel.axhline(theory.STABILITY_LIMIT, color=style.INK, linestyle="--", linewidth=1.0)
    scale = frontier.limit.values * theory.STABILITY_LIMIT
    for c in range(frontier.sizes["criterion"]):
        first, last = (scale / frontier[edge].values[c] for edge in ("first_pass", "last_fail"))
        _marks(panel, frontier.stiffness, first, last, _LOOKS[c % len(_LOOKS)])
    panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panel.yaxis.set_major_formatter("{x:g}")
    panel.yaxis.set_minor_locator(NullLocator())


def _legend(frontier: xr.Dataset) -> list[Any]:
    handles: list[Any] = []
    for c, criterion in enumerate(meanings_of(frontier.criterion)):
        look, limit = _LOOKS[c % len(_LOOKS)], 1 + float(frontier.tolerance[c])
        words = _SAY.get(criterion, criterion).format(limit=limit)
        common: Any = {"linestyle": "none", "color": look["color"]}
        handles.append(
            Line2D(
                [],
                [],
                marker=look["first"],
                markersize=5.5,
                markerfacecolor="none",
                label=f"first pass: {words}",
                **common,
            )
        )
        handles.append(Line2D([], [], marker=look["last"], markersize=4, label=f"last fail: {words}", **common))
    handles.append(Line2D([], [], color=style.INK, linestyle="--", label="theory: ωh = 2"))
    handles.append(Patch(color=style.QUIET, label="scanned cell, darker: more members fail"))
    return handles
