"""How many steps a second, by every method: a bar each, over two problems."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from stiffdice.experiments.work_precision.problems import PROBLEMS
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.report.methods import engines_note, name_of
from stiffdice.report.number_format import readable
from stiffdice.simulation.engines import registry as engines

_COLORS = (style.BLUE, style.ORANGE)
_HATCH = "////"


def draw(timings: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return bars."""
    (found,) = timings.values()
    names, problems = meanings_of(found.method), meanings_of(found.problem)
    rates = found.taken.values / found.seconds.values
    order = np.argsort(np.nan_to_num(np.nanmax(rates, axis=0)))
    figure = style.new_figure(title, width=8.5, height=0.5 * len(names) + 1.7)
    panel = figure.subplots()
    thick = 0.8 / len(problems)
    hatches = [_HATCH if engines.METHODS[names[k]].own_steps else None for k in order]
    for p, color in zip(range(len(problems)), _COLORS, strict=False):
        across = np.arange(len(names)) + (len(problems) - 1 - 2 * p) / 2 * thick
        look: dict[str, Any] = {"color": color, "edgecolor": "white", "linewidth": 0.5, "hatch": hatches}
        bars = panel.barh(across, rates[p, order], thick, **look)
        texts = ["" if np.isnan(rate) else readable(rate, digits=2) for rate in rates[p, order]]
        panel.bar_label(bars, texts, padding=3, fontsize=7.5)
    panel.set_yticks(range(len(names)), [name_of(names[k]) for k in order])
    panel.set(xscale="log", xlabel="steps a second [1/s]", xlim=(np.nanmin(rates) / 3, np.nanmax(rates) * 5))
    panel.grid(visible=False, axis="y")
    handles = [style.area(PROBLEMS[name].name, color) for color, name in zip(_COLORS, problems, strict=True)]
    own: dict[str, Any] = {"facecolor": "white", "edgecolor": style.QUIET, "hatch": _HATCH}
    handles.append(Patch(label="force evaluations: takes its own steps", **own))
    panel.legend(handles=handles, loc="lower right")
    machine = f"One thread of {found.attrs['machine_processor']}, medians of warm runs."
    style.add_note(figure, f"{machine} {engines_note([found])}")
    return figure
