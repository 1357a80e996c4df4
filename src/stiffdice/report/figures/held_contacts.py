"""Corners held by friction: error of `event` against its tolerance, and what it costs, from smooth to rough ground."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from stiffdice.report.figures import style
from stiffdice.report.number_format import ground_words


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return a column for each friction: above the error, below the force evaluations, a line for each stiffness.

    Lines are medians over the launches, dots the worst.
    """
    (dataset,) = experiments.values()
    count = dataset.sizes["friction"]
    figure = style.new_figure(title, width=2.6 * count + 1.6, height=6.0)
    rows = figure.subplots(2, count, sharex=True, sharey="row", squeeze=False)
    colors = mpl.colormaps["viridis"](np.linspace(0, 0.9, dataset.sizes["stiffness"]))
    for f, (upper, lower) in enumerate(rows.T):
        there = dataset.isel(friction=f)
        for s, color in enumerate(colors):
            _line(upper, there.tolerance, there.error.values[s], color)
            _line(lower, there.tolerance, there.evaluations.values[s].astype(float), color)
        upper.plot(there.tolerance, there.tolerance, **style.THEORY)
        upper.axhline(float(there.reference_error.median()), color=style.QUIET, linestyle=":", linewidth=1.2)
        upper.set(xscale="log", yscale="log", title=ground_words(friction=float(there.friction)))
        lower.set(xscale="log", yscale="log", xlabel="tolerance [1]")
        lower.xaxis.set_major_locator(LogLocator(numticks=6))
        lower.xaxis.set_minor_formatter(NullFormatter())
    rows[0, 0].set_ylabel("error of the position [r]")
    rows[1, 0].set_ylabel("force evaluations [1]")
    rows[0, 0].invert_xaxis()
    grounds = [ground_words(stiffness=value) for value in dataset.stiffness.values.tolist()]
    handles = [
        *(style.line(words, color=color) for words, color in zip(grounds, colors, strict=True)),
        style.mark("worst launch", ".", color=style.INK),
        style.line("the tolerance itself", **style.THEORY),
        style.line("LSODA from LSODA", color=style.QUIET, linestyle=":"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    style.add_note(figure, f"lines: medians of {dataset.sizes['launch']} launches; error: distance from LSODA at 1e-13")
    return figure


def _line(panel: Any, tolerance: xr.DataArray, values: Any, color: Any) -> None:
    """Draw the median over launches, and the worst of them, of values of shape (launch, tolerance)."""
    panel.plot(tolerance, np.nanmedian(values, axis=0), color=color, linewidth=1.2)
    panel.plot(tolerance, np.nanmax(values, axis=0), color=color, linestyle="none", marker=".", markersize=4)
