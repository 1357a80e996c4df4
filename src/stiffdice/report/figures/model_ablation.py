"""Pieces of the model: what one costs where no one needs it, and what leaving it out costs where someone does."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter, ScalarFormatter

from stiffdice.io.cf_enums import meanings_of
from stiffdice.report import number_format
from stiffdice.report.figures import style

# Of a friction coefficient, in ascending order; more of them begin anew.
_COLORS = ("#56B4E9", style.BLUE, style.GREEN, style.ORANGE, style.VERMILION, style.PURPLE)
_MARKERS = "osD^vP"
# A difference is drawn hollow unless it is so many times what the runs themselves are off by.
_CLEAR = 3.0

_KINDS = {
    "step": ("a step of the bare model", style.BLUE),
    "run": ("a run, every step taken", style.ORANGE),
    "leap": ("a run, known motion at once", style.GREEN),
}
_PIECE_WORDS = {
    "rotation": "rotation\n(tumbling / sliding)",
    "friction": "friction, place\n(sliding / vertical)",
    "contact": "contact\n(tumbling / flying)",
    "tensor": "rotating tensor\n(with / without)",
    "all": "all of a flat drop\n(tumbling / vertical)",
}


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return what the paper's ground_cube leaves out: error and parting of the paths, and the spin, against stiffness.

    experiments: one, as `experiments.pieces.measure` makes it. A row for each contact law.
    """
    (dataset,) = experiments.values()
    laws = meanings_of(dataset.contact)
    figure = style.new_figure(title, width=12.4, height=3.3 * len(laws) + 1.0)
    rows = figure.subplots(len(laws), 3, sharex=True, squeeze=False)
    for c, (law, (left, middle, right)) in enumerate(zip(laws, rows, strict=True)):
        there = dataset.isel(contact=c)
        _distances(left, there)
        _partings(middle, there)
        _spins(right, there)
        left.set_title(f"{style.LAW_NAMES[law]}: error")
        middle.set_title(f"{style.LAW_NAMES[law]}: parting")
        right.set_title(f"{style.LAW_NAMES[law]}: spin")
    for panel in rows[-1]:
        panel.set_xlabel("stiffness S [kg/s²]")
    figure.legend(handles=_legend(dataset), loc="outside right center")
    launch = json.loads(dataset.attrs["scene"])["launch"]
    style.add_note(
        figure,
        f"against the full model (tumbling), launched upright at {launch['velocity']} m/s from {launch['position']} m; "
        f"by the scheme event; hollow: less than {_CLEAR:g} times what a hundredfold tolerance changes",
    )
    return figure


def _frictions(there: xr.Dataset) -> list[tuple[int, float, dict[str, Any]]]:
    """Return index, coefficient and look of each friction but none."""
    rough = [f for f, mu in enumerate(there.friction.values) if mu > 0]
    return [
        (
            f,
            float(there.friction[f]),
            {"color": _COLORS[k % len(_COLORS)], "marker": _MARKERS[k % len(_MARKERS)], "markersize": 4},
        )
        for k, f in enumerate(rough)
    ]


def _distances(panel: Any, there: xr.Dataset) -> None:
    stiffness = there.stiffness.values
    for f, _, look in _frictions(there):
        for a, line in enumerate(("-", ":")):
            error = there.landing_error.values[a, f]
            clear = error > _CLEAR * there.numerical_error.values[f]
            panel.plot(stiffness, error, linestyle=line, color=look["color"], linewidth=1.0)
            common = look | {"linestyle": "none"}
            panel.plot(stiffness[clear], error[clear], **common)
            panel.plot(stiffness[~clear], error[~clear], **common, markerfacecolor="white")
    panel.set(xscale="log", yscale="log")
    panel.set_ylabel("distance just before the second landing [m]")


def _partings(panel: Any, there: xr.Dataset) -> None:
    for f, _, look in _frictions(there):
        for a, line in enumerate(("-", ":")):
            panel.plot(there.stiffness, there.parting_time[a, f], linestyle=line, linewidth=1.0, **look)
    panel.plot(there.stiffness, there.second_landing[0], color=style.QUIET, linestyle="--", linewidth=1.0, zorder=1)
    panel.set_xscale("log")
    panel.set_ylabel(f"time until {100 * float(there.attrs['parted']):g} cm apart [s]")


def _spins(panel: Any, there: xr.Dataset) -> None:
    """Draw spin over friction, in which theory says that all friction is alike, if little."""
    for f, mu, look in _frictions(there):
        panel.plot(there.stiffness, there.spin[f] / mu, linewidth=1.0, **look)
    f, mu, _ = _frictions(there)[0]
    panel.plot(there.stiffness, there.spin_theory[f] / mu, color=style.INK, linestyle="--", linewidth=1.0)
    panel.axhline(0, color=style.QUIET, linewidth=0.8)
    panel.text(0.98, 0.96, "< 0: rolls backwards", transform=panel.transAxes, ha="right", va="top", fontsize=8)
    panel.set_xscale("log")
    panel.set_ylabel("spin after the first landing over μ [rad/s]")


def _legend(dataset: xr.Dataset) -> list[Any]:
    handles: list[Any] = [
        Line2D([], [], label=f"μ = {number_format.readable(mu)}", linewidth=1.0, **look)
        for _, mu, look in _frictions(dataset.isel(contact=0))
    ]
    ink: dict[str, Any] = {"color": style.INK, "linewidth": 1.0}
    return [
        *handles,
        Line2D([], [], **ink, label="sliding (ground_cube)"),
        Line2D([], [], **ink, linestyle=":", label="sliding without friction"),
        Line2D([], [], **ink, linestyle="--", label="theory, small μ"),
        Line2D([], [], color=style.QUIET, linewidth=1.0, linestyle="--", label="second landing, μ = 0"),
    ]


def draw_times(timings: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return how many times longer the model with a piece takes than the one without it, where no one needs it.

    timings: as `experiments.pieces.time` makes them, a panel each.
    """
    figure = style.new_figure(title, width=4.6 * len(timings) + 1.4, height=5.4)
    panels = figure.subplots(1, len(timings), sharex=True, sharey=True, squeeze=False)[0]
    for panel, dataset in zip(panels, timings.values(), strict=True):
        _bars(panel, dataset)
        law = json.loads(dataset.attrs["scene"])["ground"]["contact"]
        panel.set_title(f"{style.LAW_NAMES[law]}: unneeded")
    panels[0].set_yticks(
        range(timings[next(iter(timings))].sizes["piece"]),
        [_PIECE_WORDS[name] for name in meanings_of(next(iter(timings.values())).piece)],
    )
    panels[0].invert_yaxis()
    handles = [Line2D([], [], color=color, linewidth=6, label=text) for text, color in _KINDS.values()]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _bars(panel: Any, dataset: xr.Dataset) -> None:
    for k, (kind, (_, color)) in enumerate(_KINDS.items()):
        ratios = dataset[f"{kind}_ratio"].values
        seconds = dataset[f"{kind}_time"].values
        places = np.arange(len(ratios)) + 0.27 * (k - 1)
        panel.barh(places, np.nan_to_num(ratios, nan=1.0) - 1, left=1.0, height=0.24, color=color)
        for place, ratio, (full, least) in zip(places, ratios, seconds, strict=True):
            if np.isfinite(ratio):
                text = f" {ratio:.3g}×: {_readable(full)} / {_readable(least)}"
                panel.text(max(1.0, ratio), place, text, va="center", fontsize=7.5)
    panel.axvline(1.0, color=style.INK, linewidth=0.8)
    panel.set_xscale("log")
    panel.set_xlim(0.6, 40 * max(4.0, float(np.nanmax([dataset[f"{kind}_ratio"] for kind in _KINDS]))))
    panel.xaxis.set_major_formatter(ScalarFormatter())
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.grid(visible=False, axis="y")
    panel.set_xlabel("time with the piece over time without it [1]")


def _readable(seconds: float) -> str:
    """Return a time as a person writes it."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"
