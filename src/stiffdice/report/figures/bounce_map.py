"""One bounce: what the time step gives it and takes from it, by ωh and phase, and how much at most."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from stiffdice.dynamics import linear_theory
from stiffdice.report.figures import style
from stiffdice.report.number_format import ground_words, readable, scene_of

# The colours are linear up to this gain, and logarithmic beyond, up to the largest there can be.
_LINEAR, _MOST = 1e-4, 8.0
# Curves of theory have this many points in a decade: enough for the dips that a pixel can show.
_FINE = 2000

# Magic steps beyond this n have no room for it.
_NUMBERED = 9

_LOOKS: dict[str, dict[str, Any]] = {
    "loss": {"color": style.BLUE, "marker": "v", "markersize": 3.5, "markeredgewidth": 0},
    "gain": {"color": style.VERMILION, "marker": "^", "markersize": 2.5, "markeredgewidth": 0},
    "gravity": {"color": style.GREEN, "marker": "o", "markersize": 3.5, "markerfacecolor": "none", "zorder": 3},
}


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the map of energy gains above, and the largest and smallest over the phases below."""
    (dataset,) = experiments.values()
    figure = style.new_figure(title, width=8.6, height=8.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1, 1.25))
    _map(figure, upper, dataset)
    _extremes(lower, dataset)
    lower.set(xlim=dataset.omega_h.values[[0, -1]], xlabel=style.OMEGA_H)
    lower.xaxis.set_major_formatter("{x:g}")
    scene = scene_of(dataset)
    note = (
        f"one bounce, undamped, frictionless, gated, {dataset.attrs['scheme'].replace('_', ' ')}; v = "
        f"{float(dataset.speed):.3g} m/s, {ground_words(stiffness=scene['ground']['stiffness'])}; "
        f"without gravity but for the points that name it, g = {scene['gravity']:g} m/s²"
    )
    style.add_note(figure, note)
    return figure


def _map(figure: Figure, panel: Any, dataset: xr.Dataset) -> None:
    # A step later all is as before: phase 1 is phase 0.
    phase = np.append(dataset.phase.values, 1.0)
    gain = np.vstack([dataset.energy_gain.values.T, dataset.energy_gain.values[:, 0]])
    scan = dataset.omega_h.values
    panel.set(xscale="log", ylim=(0.0, 1.0), ylabel="phase of the step at touch-down [1]")
    drawn = panel.pcolormesh(
        style.borders(scan, logarithmic=True),
        style.borders(phase),
        gain,
        norm=SymLogNorm(_LINEAR, linscale=0.5, vmin=-_MOST, vmax=_MOST),
        cmap="RdBu_r",
        rasterized=True,
    )
    panel.grid(visible=False)
    magic = linear_theory.magic_steps(scan[0], scan[-1])
    top = style.top_axis(panel, list(magic.values()), [str(n) if n <= _NUMBERED else "" for n in magic])
    panel.set_title("A bounce gains or loses energy by where in a step it meets the ground, but for the magic steps")
    top.set_xlabel("magic steps ωh = 2 sin(π/2n), by n [1]")
    bar = figure.colorbar(drawn, ax=panel, pad=0.01, aspect=30)
    bar.set_label(f"energy gain e²−1 [1], linear below ±{readable(_LINEAR)}")
    decades = (1e-3, 1e-2, 1e-1, 1.0, _MOST)
    bar.set_ticks([*(-value for value in decades[-2::-1]), 0, *decades])
    bar.ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}".replace("-", "−"))
    bar.ax.minorticks_off()


def _extremes(panel: Any, dataset: xr.Dataset) -> None:
    # Between what gravity leaves and round-off there is nothing to hide.
    panel.set(xscale="log", yscale="log", ylim=(1e-15, 1e2), ylabel="largest |e²−1| over the phases [1]")
    scan = dataset.omega_h.values
    fine = np.geomspace(scan[0], scan[-1], int(_FINE * np.log10(scan[-1] / scan[0])))
    peak = np.array([linear_theory.largest_gain(value) for value in fine])
    for kind, measured, curve in (
        ("loss", dataset.energy_gain.min("phase"), 1 - 1 / peak),
        ("gain", dataset.energy_gain.max("phase"), peak - 1),
    ):
        panel.plot(scan, np.abs(measured), linestyle="none", label=f"largest {kind}", **_LOOKS[kind])
        panel.plot(fine, curve, color=_LOOKS[kind]["color"], linewidth=0.5, label=f"largest {kind} by theory", zorder=2)
    bound = [linear_theory.gain_bound(value) - 1 for value in fine]
    panel.plot(fine, bound, color=style.INK, linewidth=1.0, label="bound of a gain: 1/(1 − ¼(ωh)²) − 1")
    panel.plot(fine, fine**2 / 4, label="bound of a loss: ¼(ωh)²", **style.THEORY)
    magic = np.isin(scan, list(linear_theory.magic_steps(scan[0], scan[-1]).values()))
    weighed = dataset.largest_with_gravity.values[magic]
    panel.plot(scan[magic], weighed, linestyle="none", label="at a magic step with gravity", **_LOOKS["gravity"])
    panel.plot(scan, dataset.gravity_theory, ":", color=style.GREEN, linewidth=1.0, label="theory: 2gh/v")
    panel.set_title("Up to the bound, but nothing at a magic step: only gravity is left, and round-off without it")
    panel.legend(loc="center", bbox_to_anchor=(0.5, 0.34), ncols=2)
