"""What one flat bounce becomes with longer and longer steps: a panel for each method."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullFormatter

from stiffdice.dynamics import linear_theory
from stiffdice.experiments.engines import OUTCOMES
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.report.methods import engines_note, name_of
from stiffdice.report.tables.engines import OFF, limit_of, within

_COLUMNS = 3
# Restitutions above are given by an arrow.
_HIGHEST = 3.2
_STAYS: dict[str, Any] = {"marker": "x", "markersize": 5, "color": style.INK}


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return restitution, from the least to the most over the phases, against ωh; a panel for each method."""
    (found,) = experiments.values()
    names = meanings_of(found.method)
    lines = math.ceil(len(names) / _COLUMNS)
    figure = style.new_figure(title, width=12.0, height=2.1 * lines + 1.0)
    panels = figure.subplots(lines, _COLUMNS, sharex=True, sharey=True, squeeze=False)
    for k, (name, panel) in enumerate(zip(names, panels.flat, strict=False)):
        _panel(panel, found.isel(method=k), limit_of(found.omega_h.values, within(found, k, OFF[-1])).passes)
        panel.set_title(name_of(name))
    for panel in panels.flat[len(names) :]:
        panel.set_axis_off()
    for panel in panels.flat[max(0, len(names) - _COLUMNS) : len(names)]:
        panel.set_xlabel("ωh [1]")
        panel.tick_params(labelbottom=True)
    for panel in panels[:, 0]:
        panel.set_ylabel("restitution e [1]")
    figure.legend(handles=_legend(), loc="outside right center")
    style.add_note(figure, engines_note([found]))
    return figure


def _panel(panel: Any, found: xr.Dataset, limit: float) -> None:
    omega_h, restitution = found.omega_h.values, found.restitution.values
    exact = float(found.exact_restitution)
    # Over the phases at which it leaves; not-a-number where it does at none.
    low, high = np.fmin.reduce(restitution, axis=1), np.fmax.reduce(restitution, axis=1)
    panel.set_xscale("log")
    panel.axhspan(exact * (1 - OFF[-1]), exact * (1 + OFF[-1]), color=style.FAINT, alpha=0.7, linewidth=0)
    panel.axhline(exact, **style.THEORY)
    panel.axvline(linear_theory.STABILITY_LIMIT, color=style.VERMILION, linewidth=1.0, linestyle=":")
    panel.fill_between(omega_h, low, high, color=style.BLUE, alpha=0.35, linewidth=0)
    for edge in (low, high):
        panel.plot(omega_h, edge, color=style.BLUE, linewidth=1.0)
    stays = (found.outcome.values != OUTCOMES.index("leaves")).any(axis=1)
    panel.plot(omega_h, np.where(stays, 0.0, np.nan), linestyle="none", **_STAYS)
    if limit < omega_h[-1]:
        panel.axvline(limit, color=style.GREEN, linewidth=1.2)
    top = float(np.nanmax(high))
    if top > _HIGHEST:
        style.write_in_corner(panel, 0.03, f"↑ to e = {top:.3g}\nat ωh = {omega_h[int(np.nanargmax(high))]:.3g}")
    panel.set(xlim=omega_h[[0, -1]], ylim=(-0.12, _HIGHEST))
    panel.xaxis.set_major_locator(FixedLocator([0.02, 0.1, 0.5, 2, 10]))
    panel.xaxis.set_major_formatter("{x:g}")
    panel.xaxis.set_minor_formatter(NullFormatter())


def _legend() -> list[Any]:
    return [
        style.area("least to most over\nthe phases of the step\nat touch-down", style.BLUE, alpha=0.35),
        style.line("exact", **style.THEORY),
        style.area(f"within {OFF[-1]:.0%} of it", style.FAINT),
        style.line("all phases within,\nup to here", color=style.GREEN),
        style.line("ωh = 2: symplectic Euler's\nlimit of stability", color=style.VERMILION, linestyle=":"),
        style.mark("at some phase it does\nnot leave the ground", **_STAYS),
    ]
