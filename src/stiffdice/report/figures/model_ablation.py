"""Pieces of the model: what one costs where no one needs it, and what leaving it out costs where someone does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.report.number_format import duration, ground_words, scene_of

# A difference is drawn hollow unless it is so many times what the runs themselves are off by.
_CLEAR = 3.0
# By approximation: sliding, and sliding without friction.
_LINES = ("-", ":")

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

    A row for each contact law.
    """
    (dataset,) = experiments.values()
    laws = style.by_law([dataset])
    figure = style.new_figure(title, style.PAGE, 2.2 * len(laws) + 1.2)
    rows = figure.subplots(len(laws), 3, sharex=True, squeeze=False)
    rough = dataset.friction.values[dataset.friction.values > 0].tolist()
    looks = zip(rough, style.ordered(len(rough)), strict=True)
    looks_of = {mu: {**look, "markersize": 3, "linewidth": 0.9} for mu, look in looks}
    for there, row in zip(laws, rows, strict=True):
        for panel, name in zip(row, ("error", "parting", "spin"), strict=True):
            panel.set(xscale="log", title=f"{style.law_of(there)}: {name}")
        _draw_law(row, there, looks_of)
    for panel in rows[-1]:
        panel.set_xlabel(style.STIFFNESS)
    handles = [
        *(style.line(ground_words(friction=mu), **look) for mu, look in looks_of.items()),
        style.line("sliding (ground_cube)", **style.THEORY | {"linestyle": "-"}),
        style.line("sliding without friction", **style.THEORY | {"linestyle": ":"}),
        style.line("theory, small μ", **style.THEORY),
        style.line("second landing, μ = 0", **style.THEORY | {"color": style.QUIET}),
    ]
    style.add_legend(figure, handles)
    launch = scene_of(dataset)["launch"]
    style.add_note(
        figure,
        f"against the full model (tumbling), launched upright at {launch['velocity']} m/s from {launch['position']} m; "
        f"by the scheme event; hollow: less than {_CLEAR:g} times what a hundredfold tolerance changes",
    )
    return figure


def _draw_law(row: Any, there: xr.Dataset, looks: Mapping[float, Any]) -> None:
    """Draw a line for each friction; spin over friction, in which theory says that all friction is alike, if little."""
    errors, partings, spins = row
    stiffness = there.stiffness.values
    for mu, look in looks.items():
        found = there.isel(friction=there.friction.values.tolist().index(mu))
        for a, line in enumerate(_LINES):
            error = found.landing_error.values[a]
            clear = error > _CLEAR * found.numerical_error.values
            errors.plot(stiffness, error, **look | {"linestyle": line, "marker": ""})
            errors.plot(stiffness[clear], error[clear], **look | {"linestyle": "none"})
            errors.plot(stiffness[~clear], error[~clear], **look, linestyle="none", markerfacecolor=style.PAPER)
            partings.plot(stiffness, found.parting_time[a], **look, linestyle=line)
        spins.plot(stiffness, found.spin / mu, **look)
    errors.set(yscale="log", ylabel="distance just before the second landing [m]")
    partings.plot(stiffness, there.second_landing[0], color=style.QUIET, linestyle="--", linewidth=1.0, zorder=1)
    partings.set_ylabel(f"time until {100 * float(there.attrs['parted']):g} cm apart [s]")
    least = min(looks)
    spins.plot(stiffness, there.spin_theory[there.friction.values.tolist().index(least)] / least, **style.THEORY)
    spins.axhline(0, color=style.QUIET, linewidth=0.8)
    style.write_in_corner(spins, 0.98, "< 0: rolls backwards")
    spins.set_ylabel("spin after the first landing over μ [rad/s]")


def draw_times(timings: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return how many times longer the model with a piece takes than the one without it, where no one needs it."""
    figure = style.new_figure(title, style.PAGE, 3.6)
    panels = figure.subplots(1, len(timings), sharex=True, sharey=True, squeeze=False)[0]
    for panel, dataset in zip(panels, timings.values(), strict=True):
        for k, (kind, (_, color)) in enumerate(_KINDS.items()):
            ratios = dataset[f"{kind}_ratio"].values
            places = np.arange(len(ratios)) + 0.27 * (k - 1)
            panel.barh(places, np.nan_to_num(ratios, nan=1.0) - 1, left=1.0, height=0.24, color=color)
            for place, ratio, (full, least) in zip(places, ratios, dataset[f"{kind}_time"].values, strict=True):
                if np.isfinite(ratio):
                    text = f" {ratio:.3g}×: {duration(full)} / {duration(least)}"
                    panel.text(max(1.0, ratio), place, text, va="center", fontsize=style.SMALL)
        panel.axvline(1.0, color=style.INK, linewidth=0.8)
        most = float(np.nanmax([dataset[f"{kind}_ratio"] for kind in _KINDS]))
        panel.set(xscale="log", xlim=(0.6, 40 * max(4.0, most)), xlabel="time with the piece over time without it [1]")
        panel.xaxis.set_major_formatter(ScalarFormatter())
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.grid(visible=False, axis="y")
        law = scene_of(dataset)["ground"]["contact"]
        panel.set_title(f"{style.LAW_NAMES[law]}: unneeded")
    pieces = meanings_of(next(iter(timings.values())).piece)
    panels[0].set_yticks(range(len(pieces)), [_PIECE_WORDS[name] for name in pieces])
    panels[0].invert_yaxis()
    handles = [style.line(text, color=color, linewidth=5) for text, color in _KINDS.values()]
    style.add_legend(figure, handles)
    return figure
