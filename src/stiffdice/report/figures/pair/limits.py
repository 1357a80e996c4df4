"""Figure 13 for two cubes: the steps they need against stiffness, by how they meet, and as predicted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffdice.report import pair_words
from stiffdice.report.figures import style
from stiffdice.report.number_format import scene_of

_EDGES = {
    "first_pass": ("first pass", {"marker": "v", "color": style.ORANGE}),
    "steps_needed": ("all pass from here on", {"marker": "o", "color": style.BLUE}),
    "last_fail": ("last fail", {"marker": "^", "color": style.VERMILION}),
}
_LINES: dict[str, tuple[str, dict[str, Any]]] = {
    "limit": ("linear limit of the bounce: ωh = 2 without damping", style.THEORY),
    "gain": ("no phase gains more than 5 %", {"color": style.GREEN, "linewidth": 1.1}),
    "bound": ("proven: ωh < 0.436", {"color": style.GREEN, "linestyle": ":", "linewidth": 1.1}),
}


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return a panel for each case."""
    cases = pair_words.cases_of(experiments)
    figure = style.new_figure(title, style.PAGE, 0.8 + 2.5 * ((len(cases) + 1) // 2))
    panels = figure.subplots((len(cases) + 1) // 2, 2, sharex=True, sharey=True, squeeze=False)
    for panel, (name, found) in zip(panels.flat, cases.items(), strict=False):
        _draw_case(panel, found)
        slope = f"{float(found.exponent):.3f} ± {float(found.exponent_error):.3f}"
        panel.set_title(f"{pair_words.CASES[name]}: ω² = {float(found.mode_number[0]):.4g} S/m, slope {slope}")
    for panel in panels.flat[len(cases) :]:
        panel.set_visible(False)
    for panel in panels[-1]:
        panel.set_xlabel(style.STIFFNESS)
    for panel in panels[:, 0]:
        panel.set_ylabel("steps [1]")
    handles = [
        style.mark(words, look["marker"], color=look["color"], markersize=3.5) for words, look in _EDGES.values()
    ]
    handles += [style.line(words, **look) for words, look in _LINES.values()]
    first = next(iter(experiments.values()))
    told = (
        f"symplectic Euler, {int(first.attrs['members'])} phases of a step each, {scene_of(first)['duration']:g} s; "
        f"{first.attrs['speed']:g} m/s without gravity and damping; of the stack ζ = {first.attrs['zeta']:g}; "
        "grey: a phase fails"
    )
    style.add_legend(figure, handles, told)
    return figure


def _draw_case(panel: Any, found: xr.Dataset) -> None:
    stiffness = found.stiffness.values
    failing = np.where(found.pass_fraction < 1, found.scanned, np.nan)
    panel.plot(stiffness, failing, linestyle="none", marker="_", color=style.FAINT, markersize=4, zorder=1)
    for name, (_, look) in _LINES.items():
        panel.plot(stiffness, found[name], zorder=2, **look)
    for name, (_, look) in _EDGES.items():
        panel.plot(stiffness, found[name], linestyle="none", markersize=3.5, zorder=3, **look)
    panel.set(xscale="log", yscale="log")
