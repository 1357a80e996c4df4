"""The edge of `apex` against the height from which rebounds count, a line for each duration."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from stiffdice.io.cf_enums import meanings_of
from stiffdice.report import number_format
from stiffdice.report.figures import style

# Light to dark with the duration, each with a mark of its own.
_LOOKS = (("#9ecae1", "v"), ("#4292c6", "o"), ("#08519c", "s"), ("#04244f", "D"), ("#000000", "^"))


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return ωh of the last fail against hop height, a panel for each experiment and contact law."""
    columns = [found.isel(contact=k) for found in experiments.values() for k in range(found.sizes["contact"])]
    figure = style.new_figure(title, width=4.2 * len(columns) + 0.6, height=4.2)
    panels = figure.subplots(1, len(columns), sharex=True, sharey=True, squeeze=False)[0]
    for panel, found in zip(panels, columns, strict=True):
        _panel(panel, found)
    panels[0].set_ylabel("ωh of the last fail [1]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def _panel(panel: Any, found: xr.Dataset) -> None:
    ground = json.loads(found.attrs["scene"])["ground"]
    panel.set_title(
        f"{style.LAW_NAMES[meanings_of(found.contact)[int(found.contact)]]}, "
        f"S = {number_format.readable(ground['stiffness'])} kg/s², D = {number_format.readable(ground['damping'])} kg/s"
    )
    heights = found.hop_height.values
    for k, seconds in enumerate(found.duration.values):
        color, mark = _LOOKS[min(k, len(_LOOKS) - 1)]
        panel.plot(
            heights, found.last_fail.values[k], color=color, marker=mark, markersize=4, label=f"runs of {seconds:g} s"
        )
    panel.plot(
        heights, found.predicted, color=style.INK, linestyle="--", linewidth=1.0, label="theory: largest gain × R(H)"
    )
    panel.set(xscale="log", yscale="log")
    panel.yaxis.set_major_locator(FixedLocator([0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0]))
    panel.yaxis.set_major_formatter("{x:g}")
    panel.yaxis.set_minor_locator(NullLocator())
    panel.set_ylim(0.2, 2.0)
    panel.set_xlabel("rebounds count from this height on [m]")
