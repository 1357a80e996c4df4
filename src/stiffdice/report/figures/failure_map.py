"""Where and how runs fail: a map for each number of the scene and contact law, verdicts over steps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import patheffects
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from stiffdice.dynamics.state import Array
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.report.number_format import readable
from stiffdice.simulation.outcome import Verdict

_NAMES = {
    "stiffness": style.STIFFNESS,
    "damping": "damping D [kg/s]",
    "friction": "friction coefficient μ [1]",
    "mass": "mass m [kg]",
    "radius": "radius r [m]",
    "spin": "rate of spin [rad/s]",
    "start": "start [by name]",
}
_LIMIT_LOOKS: dict[str, dict[str, Any]] = {
    "contact": {"linestyle": "-", "label": "theory: fastest contact, ωh = 2(√(1 + ζ²) − ζ)"},
    "drag": {"linestyle": "--", "label": "theory: drag in mid-air (ungated), 8 D h/m = 2, or 12 if it turns"},
    "turn": {"linestyle": "-.", "label": "theory: half a turn in a step"},
    "stall": {"linestyle": ":", "label": "theory: a step at launch is half a unit in the last place of z"},
}
# Between the row of zero and the others, in rows.
_GAP = 0.4


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the maps, two for each axis side by side, with theory's limits over them."""
    found = list(experiments.values())
    rows = math.ceil(len(found) / 2)
    figure = style.new_figure(title, style.PAGE, 1.6 + 1.9 * rows)
    panels = figure.subplots(rows, 4, squeeze=False).reshape(rows * 2, 2)
    for pair, dataset in zip(panels, found, strict=False):
        for law, panel in enumerate(pair):
            _map(panel, dataset.isel(contact=law))
        pair[0].set_ylabel(_NAMES[dataset.attrs["axis"]])
        pair[1].tick_params(labelleft=False)
    if len(found) % 2:
        for panel in panels[-1]:
            panel.remove()
    style.add_legend(figure, _legend(found))
    return figure


def _map(panel: Any, dataset: xr.Dataset) -> None:
    heights, edges = _rows(dataset), style.borders(dataset.steps.values, logarithmic=True)
    step, names = _height(heights), meanings_of(dataset.verdict)
    for height, verdicts in zip(heights, dataset.verdict.values, strict=True):
        changes = np.flatnonzero(np.diff(verdicts)) + 1
        for first, last in zip([0, *changes], [*changes, len(verdicts)], strict=True):
            left, right = edges[[first, last]]
            place = {"xy": (left, height - step / 2), "width": right - left, "height": step}
            panel.add_patch(Rectangle(**place, **_fill(names[verdicts[first]])))
    # A limit is a line through all numbers but zero, and a stroke in each row that stands alone.
    numbers = heights > heights.min() + step if np.diff(np.sort(heights))[:1] > step else np.ones(len(heights), bool)
    for name, limits in zip(meanings_of(dataset.limit), dataset.limit_steps.values, strict=True):
        look = {"linestyle": _LIMIT_LOOKS[name]["linestyle"], "color": style.INK, "linewidth": 1.0, "label": name}
        look["path_effects"] = [patheffects.withStroke(linewidth=2.0, foreground=style.PAPER)]
        panel.plot(limits[numbers], heights[numbers], **look)
        for height, limit in zip(heights[~numbers], limits[~numbers], strict=True):
            panel.plot([limit, limit], [height - step / 2, height + step / 2], **look)
    panel.set(xscale="log", xlim=edges[[0, -1]], ylim=(heights.min() - step / 2, heights.max() + step / 2))
    panel.grid(visible=False)
    value = dataset["value"]
    if "flag_meanings" in value.attrs:
        panel.set_yticks(heights, [meanings_of(value)[int(k)].replace("_", " ") for k in value.values])
    else:
        # Zero, and of many numbers each so many.
        every = math.ceil((value.values > 0).sum() / 8) if len(heights) > 12 else 1
        shown = [*np.flatnonzero(value.values == 0), *np.flatnonzero(value.values > 0)[::every]]
        panel.set_yticks(heights[shown], [readable(float(value.values[k])) for k in shown])
    panel.set_xlabel("time steps [1]")
    panel.set_title(f"{dataset.attrs['axis']}, {style.law_of(dataset)}", fontsize=style.SMALL)


def _fill(verdict: str) -> dict[str, Any]:
    look = style.VERDICT_LOOKS[verdict]
    edge = (
        {"edgecolor": style.QUIET, "linewidth": 0.0}
        if "hatch" in look
        else {"edgecolor": style.PAPER, "linewidth": 0.4}
    )
    return {"facecolor": look["color"], "hatch": look.get("hatch"), **edge}


def _rows(dataset: xr.Dataset) -> Array:
    """Return where each value lies: named ones in order, numbers by their logarithm, zero below all others."""
    if "flag_meanings" in dataset["value"].attrs:
        return np.arange(dataset.sizes["value"], dtype=float)
    values = dataset["value"].values
    heights = np.log10(np.where(values > 0, values, np.nan))
    return np.nan_to_num(heights, nan=np.nanmin(heights) - _height(heights[values > 0]) - _GAP)


def _height(heights: Array) -> float:
    """Return how high a row is: as far as the nearest two are apart."""
    return float(np.diff(np.sort(heights)).min()) if len(heights) > 1 else 1.0


def _legend(found: list[xr.Dataset]) -> list[Any]:
    names, limits = meanings_of(found[0].verdict), meanings_of(found[0].limit)
    occurring = {names[verdict] for dataset in found for verdict in np.unique(dataset.verdict.values)}
    handles: list[Any] = [
        Patch(**_fill(name) | {"linewidth": 0.4, "edgecolor": style.QUIET}, label=Verdict[name.upper()].sentence)
        for name in style.VERDICT_LOOKS
        if name in occurring
    ]
    for name, look in _LIMIT_LOOKS.items():
        if any(np.isfinite(dataset.limit_steps.values[limits.index(name)]).any() for dataset in found):
            handles.append(style.line(color=style.INK, linewidth=1.0, **look))
    return handles
