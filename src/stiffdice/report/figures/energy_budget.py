"""Where the energy of each bounce goes, at a few numbers of steps: damping, friction, and what the scheme makes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffdice.report.figures import style

# By what is booked: a look, and words. Gains are marks that point up, losses marks that point down.
_LOOKS: dict[str, tuple[str, str]] = {
    "friction_work": (style.QUIET, "friction"),
    "damping_work": (style.BLUE, "damping (and drag during the bounce)"),
    "scheme_work": (style.VERMILION, "the scheme itself"),
}

SMALLEST = 1e-5  # [J]; less than a millionth of what the cube has


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the works of the first bounces on a logarithmic scale, a panel for each contact law."""
    (books,) = experiments.values()
    laws = style.by_law([books])
    figure = style.new_figure(title, width=9.0, height=1.6 + 2.7 * len(laws))
    panels = figure.subplots(len(laws), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for panel, law in zip(panels, laws, strict=True):
        _panel(panel, law)
        panel.set(title=style.law_of(law), ylabel="work in one bounce [J]")
    numbers = zip(books.steps.values, books.omega_h.values, strict=True)
    labels = [f"{steps:,}\nωh = {omega_h:.3g}" for steps, omega_h in numbers]
    panels[-1].set_xticks(range(len(labels)), labels)
    panels[0].set_ylim(SMALLEST, 3 * np.nanmax([np.abs(books[name].values) for name in _LOOKS]))
    panels[-1].set_xlim(-0.5, len(labels) - 0.5)
    panels[-1].set_xlabel(
        "number of time steps [1], and ωh; in each group the first bounces from left to right; "
        f"below {SMALLEST:g} J not shown"
    )
    handles = [
        *(style.mark(text, "s", color=color) for color, text in _LOOKS.values()),
        style.mark("full, up: energy gained", "^", color=style.INK),
        style.mark("open, down: energy lost", "v", color=style.INK, markerfacecolor="none"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _panel(panel: Any, books: xr.Dataset) -> None:
    panel.set_yscale("log")
    count = books.sizes["bounce"]
    offsets = (np.arange(count) - (count - 1) / 2) * 0.7 / count
    for name, (color, _) in _LOOKS.items():
        values = books[name].values + (books.drag_work.values if name == "damping_work" else 0.0)
        for sign, marker, fill in ((1, "^", color), (-1, "v", "none")):
            group, bounce = np.nonzero(sign * values > 0)
            look = {"color": color, "markerfacecolor": fill, "markersize": 5}
            panel.plot(group + offsets[bounce], np.abs(values[group, bounce]), marker, **look)
    for edge in range(1, books.sizes["steps"]):
        panel.axvline(edge - 0.5, color=style.FAINT, linewidth=0.8)
    panel.grid(axis="x", visible=False)
