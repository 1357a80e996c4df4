"""How two cubes leave each other: spin and energy against offset, by friction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffdice.io.cf_enums import meanings_of
from stiffdice.report import pair_words
from stiffdice.report.figures import style

# Of a spin, in units of speed over side: what a line is wide. Points whose step error is larger are marked.
_WIDTH = 0.02


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return a row for each pose: the spin of either cube, and the energy of both; at the largest restitution."""
    (found,) = experiments.values()
    poses = meanings_of(found.pose)
    figure = style.new_figure(title, style.PAGE, 2.0 * len(poses) + 0.9)
    panels = figure.subplots(len(poses), 3, sharex=True, squeeze=False)
    colors = [look["color"] for look in style.ordered(found.sizes["friction"])]
    chosen = found.isel(restitution=int(np.argmax(found.restitution.values)))
    for row, pose in enumerate(poses):
        _draw_pose(panels[row], chosen.isel(pose=row), pair_words.spin_of_units(found), colors)
        panels[row, 0].set_title(pair_words.POSES[pose])
    for panel in panels[-1]:
        panel.set_xlabel("offset of the centres over the side [1]")
    handles = [style.line(f"μ = {mu:g}", color=color) for mu, color in zip(found.friction.values, colors, strict=True)]
    handles += [
        style.line("one impulse, μ = 0", **style.THEORY),
        style.mark("they met again", ".", color=style.INK, markersize=3.5),
        style.mark("step error above a line's width", "o", color=style.INK, fillstyle="none", markersize=3.5),
    ]
    told = (
        f"e = {float(chosen.restitution):g}; velocity Verlet, ωh = {found.attrs['omega_h']:g}; "
        f"S = {found.attrs['stiffness']:g} kg/s²; v = {found.attrs['speed']:g} m/s; s: the side"
    )
    style.add_legend(figure, handles, told)
    return figure


def _draw_pose(panels: Any, found: xr.Dataset, scale: float, colors: Any) -> None:
    offset, off, again = found.offset.values, found.spin_error.values / scale > _WIDTH, found.meetings.values > 1
    for body, words in enumerate(("moving", "struck")):
        for k, color in enumerate(colors):
            spin = found.spin.values[k, :, body] / scale
            panels[body].plot(offset, spin, color=color)
            panels[body].plot(offset[again[k]], spin[again[k]], ".", color=color, markersize=3.5)
            panels[body].plot(offset[off[k]], spin[off[k]], "o", color=color, fillstyle="none", markersize=3.5)
        panels[body].plot(offset, found.impulse_spin.values[:, body] / scale, **style.THEORY)
        panels[body].set_ylabel(f"spin of the {words} cube [v/s]")
    for k, color in enumerate(colors):
        panels[2].plot(offset, found.energy.values[k].sum(axis=-1), color=color)
    panels[2].set_ylabel("energy of both after over before [1]")
