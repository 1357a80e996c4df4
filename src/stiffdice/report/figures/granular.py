"""What the steps of an impact between two spheres do to its restitution, and what rules of granular codes allow."""

from __future__ import annotations

import math
from collections.abc import Mapping

import xarray as xr
from matplotlib.figure import Figure

from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style

_LOOKS = {"linear": (style.BLUE, "o", "-"), "hertz": (style.VERMILION, "s", "--")}
_NAMES = {"linear": "linear", "hertz": "Hertz"}
# exaDEM's longest step over the duration of an impact of two equal spheres.
_EXADEM = math.sqrt(2)


def impacts(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the least and largest restitution of an undamped impact against the step over its duration."""
    (dataset,) = experiments.values()
    figure = style.new_figure(title, height=3.1)
    panel = figure.subplots()
    parts = dataset.part.values
    panel.axvspan(0.1, 0.2, color=style.GREEN, alpha=0.15, linewidth=0)
    panel.axvline(_EXADEM, color=style.INK, linestyle=":", linewidth=1.0)
    panel.axhline(1.0, **style.THEORY)
    for k, force in enumerate(meanings_of(dataset.force)):
        color, marker, dashes = _LOOKS[force]
        panel.fill_between(parts, dataset.least[k], dataset.largest[k], color=color, alpha=0.15, linewidth=0)
        for ends in (dataset.least[k], dataset.largest[k]):
            panel.plot(parts, ends, color=color, marker=marker, markersize=2.5, linestyle=dashes)
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlim(parts.min() * 0.85, parts.max() * 1.6)
    style.write_beside(panel, "0.1 to 0.2:\nmanuals", (0.15, 0.3), (0, 0), ha="center")
    style.write_beside(panel, "exaDEM's\nπ√(m/k)", (_EXADEM, 0.7), (4, 0))
    style.plain_log_ticks(panel.xaxis)
    style.plain_log_ticks(panel.yaxis)
    panel.set(xlabel="step over the duration of the impact [1]", ylabel="speed out over speed in,\nover all phases [1]")
    handles = [style.line(f"{_NAMES[name]} force", color=look[0], linestyle=look[2]) for name, look in _LOOKS.items()]
    style.add_legend(figure, [*handles, style.line("exact: no damping", **style.THEORY)])
    return figure
