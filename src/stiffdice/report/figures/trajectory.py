"""Figures 4 to 12: position and energy of a run against time, one reading of the paper's physics over another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffdice.report.figures import style
from stiffdice.report.number_format import describe


def position(runs: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return x, y and z of the centre of mass against time; y only where the cube leaves the plane y = 0."""
    leaves_plane = any(np.abs(run.position[:, 1]).max() > 1e-9 for run in runs.values())
    shown = (0, 1, 2) if leaves_plane else (0, 2)
    figure = style.new_figure(title, height=1.4 + 1.35 * len(shown))
    panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for panel, k in zip(panels, shown, strict=True):
        for preset, run in runs.items():
            panel.plot(run.time, run.position[:, k], **style.PRESET_LOOKS[preset])
        panel.set_ylabel(f"{'xyz'[k]} [m]")
    panels[-1].axhline(0, color=style.INK, linewidth=0.8, linestyle=":")
    panels[-1].annotate("ground", (0.005, 0), xycoords=("axes fraction", "data"), ha="left", va="bottom", fontsize=7.5)
    panels[0].legend(ncols=3, loc="upper left")
    return _finish(figure, panels[-1], runs)


def energy(runs: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the paper's energy and the mechanical one against time, a panel for each preset.

    The mechanical one takes the velocity at the time of the place; files of before format 1.3 lack it, and get the sum
    of the stored energies.
    """
    figure = style.new_figure(title, height=1.3 + 1.75 * len(runs))
    panels = figure.subplots(len(runs), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for panel, (preset, run) in zip(panels, runs.items(), strict=True):
        look = style.PRESET_LOOKS[preset]
        full = run.get("mechanical_energy", run.energy_paper + run.elastic_energy)
        panel.axhline(float(full[0]), color=style.INK, linewidth=0.8, linestyle=":", label="energy at launch")
        panel.plot(run.time, full, color=style.INK, linewidth=2.4, label="mechanical: with the springs")
        panel.plot(run.time, run.energy_paper, color=look["color"], label="paper's: kinetic + m g z", zorder=3)
        panel.set_title(look["label"])
        panel.set_ylabel("energy [J]")
        panel.legend(ncols=3, loc="lower right", bbox_to_anchor=(1, 0.97), borderaxespad=0)
    lowest = min(0.0, *(float(run.energy_paper.min()) for run in runs.values()))
    panels[0].set_ylim(bottom=lowest)  # after all is drawn: it ends the automatic scaling
    return _finish(figure, panels[-1], runs)


def _finish(figure: Figure, lowest: Any, runs: Mapping[str, xr.Dataset]) -> Figure:
    lowest.set_xlabel("time [s]")
    lowest.margins(x=0.01)
    style.add_note(figure, describe(next(iter(runs.values()))))
    return figure
