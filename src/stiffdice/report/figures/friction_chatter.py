"""Chatter of a cube at rest: the swing of its sliding speed against the step size, over theory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffdice.report.figures import style
from stiffdice.report.number_format import ground_words, readable

_LOOKS = [(style.BLUE, "o"), (style.VERMILION, "s"), (style.GREEN, "D"), (style.ORANGE, "^"), (style.PURPLE, "v")]


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the swing against the step size for each friction; open marks on the axis are cubes at rest."""
    (dataset,) = experiments.values()
    figure = style.new_figure(title, width=6.4, height=4.6)
    panel: Any = figure.subplots()
    sizes, swings = dataset.step_size.values, dataset.swing.values
    least_swing = dataset.swing_theory.values[dataset.swing_theory.values > 0].min()
    lowest = float(10 ** np.floor(np.log10(least_swing) - 0.5))
    panel.set(xscale="log", yscale="log", ylim=(lowest, 3 * swings.max()))
    panel.set(xlabel="step size h [s]", ylabel="largest sliding speed of a cube at rest [m/s]")
    for k, mu in enumerate(dataset.friction.values):
        color, marker = _LOOKS[k % len(_LOOKS)]
        least = float(dataset.least_step[k])
        rests = swings[k] < lowest
        size = max(3, 8 - 2 * k)
        common: Any = {"linestyle": "none", "marker": marker, "color": color, "markersize": size, "zorder": 3}
        panel.plot(sizes[~rests], swings[k, ~rests], label=ground_words(friction=float(mu)), **common)
        panel.plot(sizes[rests], np.full(rests.sum(), lowest), markerfacecolor="none", clip_on=False, **common)
        if least < sizes.max():
            fine = least * np.geomspace(1 + 1e-9, sizes.max() / least, 1000)
            cutoff = float(dataset.swing_theory[k, -1]) / (sizes[-1] / least - 1)
            panel.plot(fine, cutoff * (fine / least - 1), **style.THEORY)
            look = {"rotation": 90, "ha": "right", "va": "bottom", "color": color}
            style.write_beside(panel, f"{readable(least)} s", (least, lowest), (-2, 12), **look)
    panel.plot([], [], label="theory: μ g h/2 − umin, from h = 2 umin/(μ g) on", **style.THEORY)
    panel.plot([], [], "o", color=style.QUIET, markerfacecolor="none", label="comes to rest", markersize=5)
    panel.legend(loc="upper left", fontsize=7.5)
    return figure
