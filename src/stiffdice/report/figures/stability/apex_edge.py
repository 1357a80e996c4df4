"""The edge of `apex` against the height from which rebounds count, a line for each duration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr
from matplotlib.figure import Figure

from stiffdice.report.figures import style
from stiffdice.report.number_format import ground_words, scene_of

# Light to dark with the duration, each with a mark of its own.
_LOOKS = (("#9ecae1", "v"), ("#4292c6", "o"), ("#08519c", "s"), ("#04244f", "D"), ("#000000", "^"))


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return ωh of the last fail against hop height, a panel for each experiment and contact law."""
    columns = style.by_law(experiments.values())
    figure = style.new_figure(title, width=4.2 * len(columns) + 0.6, height=4.2)
    panels = figure.subplots(1, len(columns), sharex=True, sharey=True, squeeze=False)[0]
    for panel, found in zip(panels, columns, strict=True):
        _panel(panel, found)
    panels[0].set_ylabel("ωh of the last fail [1]")
    figure.legend(handles=panels[0].get_lines(), loc="outside lower center", ncols=len(panels[0].get_lines()))
    return figure


def _panel(panel: Any, found: xr.Dataset) -> None:
    ground = scene_of(found)["ground"]
    panel.set_title(f"{style.law_of(found)}, {ground_words(stiffness=ground['stiffness'], damping=ground['damping'])}")
    heights = found.hop_height.values
    for k, seconds in enumerate(found.duration.values):
        color, mark = _LOOKS[min(k, len(_LOOKS) - 1)]
        look = {"color": color, "marker": mark, "markersize": 4, "label": f"runs of {seconds:g} s"}
        panel.plot(heights, found.last_fail.values[k], **look)
    panel.plot(heights, found.predicted, label="theory: largest gain × R(H)", **style.THEORY)
    panel.set(xscale="log", yscale="log", ylim=(0.2, 2.0), xlabel="rebounds count from this height on [m]")
    style.plain_log_ticks(panel.yaxis, (1.0, 1.5, 2.0, 3.0, 5.0, 7.0))
