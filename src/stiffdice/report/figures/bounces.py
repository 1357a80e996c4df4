"""Bounces: what the time step gives one and takes from it, where its energy goes, and from what height one counts."""

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

_EXTREMES: dict[str, dict[str, Any]] = {
    "loss": {"color": style.BLUE, "marker": "v", "markersize": 3, "markeredgewidth": 0},
    "gain": {"color": style.VERMILION, "marker": "^", "markersize": 2.5, "markeredgewidth": 0},
    "gravity": {"color": style.GREEN, "marker": "o", "markersize": 3.5, "markerfacecolor": "none", "zorder": 3},
}

# By what is booked: a colour, and words. Gains are marks that point up, losses marks that point down.
_WORKS = {
    "friction_work": (style.QUIET, "friction"),
    "damping_work": (style.BLUE, "damping (and drag during the bounce)"),
    "scheme_work": (style.VERMILION, "the scheme itself"),
}
SMALLEST = 1e-5  # [J]; less than a millionth of what the cube has


def bounce_map(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the map of energy gains by ωh and phase above, and the largest and smallest over the phases below."""
    (dataset,) = experiments.values()
    figure = style.new_figure(title, style.PAGE, 6.6)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1, 1.25))
    _gains(figure, upper, dataset)
    _extremes(lower, dataset)
    style.add_legend(figure, lower.get_legend_handles_labels()[0])
    lower.set(xlim=dataset.omega_h.values[[0, -1]], xlabel=style.OMEGA_H)
    style.plain_log_ticks(lower.xaxis)
    scene = scene_of(dataset)
    note = (
        f"one bounce, undamped, frictionless, gated, {dataset.attrs['scheme'].replace('_', ' ')}; v = "
        f"{float(dataset.speed):.3g} m/s, {ground_words(stiffness=scene['ground']['stiffness'])}; "
        f"without gravity but for the points that name it, g = {scene['gravity']:g} m/s²"
    )
    style.add_note(figure, note)
    return figure


def _gains(figure: Figure, panel: Any, dataset: xr.Dataset) -> None:
    # A step later all is as before: phase 1 is phase 0.
    phase = np.append(dataset.phase.values, 1.0)
    gain = np.vstack([dataset.energy_gain.values.T, dataset.energy_gain.values[:, 0]])
    scan = dataset.omega_h.values
    panel.set(xscale="log", ylim=(0.0, 1.0), ylabel="phase of the step at touch-down [1]")
    norm = SymLogNorm(_LINEAR, linscale=0.5, vmin=-_MOST, vmax=_MOST)
    borders = style.borders(scan, logarithmic=True), style.borders(phase)
    drawn = panel.pcolormesh(*borders, gain, norm=norm, cmap=style.GAINS, rasterized=True)
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
        look = _EXTREMES[kind]
        panel.plot(scan, np.abs(measured), linestyle="none", label=f"largest {kind}", **look)
        panel.plot(fine, curve, color=look["color"], linewidth=0.5, label=f"largest {kind} by theory", zorder=2)
    bound = [linear_theory.gain_bound(value) - 1 for value in fine]
    panel.plot(fine, bound, color=style.INK, linewidth=1.0, label="bound of a gain: 1/(1 − ¼(ωh)²) − 1")
    panel.plot(fine, fine**2 / 4, label="bound of a loss: ¼(ωh)²", **style.THEORY)
    magic = np.isin(scan, list(linear_theory.magic_steps(scan[0], scan[-1]).values()))
    weighed = dataset.largest_with_gravity.values[magic]
    panel.plot(scan[magic], weighed, linestyle="none", label="at a magic step with gravity", **_EXTREMES["gravity"])
    panel.plot(scan, dataset.gravity_theory, ":", color=style.GREEN, linewidth=1.0, label="theory: 2gh/v")
    panel.set_title("Up to the bound, but nothing at a magic step: only gravity is left, and round-off without it")


def energy_budget(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the works of the first bounces on a logarithmic scale, a panel for each contact law."""
    (books,) = experiments.values()
    laws = style.by_law([books])
    figure = style.new_figure(title, style.PAGE, 1.3 + 2.1 * len(laws))
    panels = figure.subplots(len(laws), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    count = books.sizes["bounce"]
    offsets = (np.arange(count) - (count - 1) / 2) * 0.7 / count
    for panel, law in zip(panels, laws, strict=True):
        panel.set_yscale("log")
        for name, (color, _) in _WORKS.items():
            values = law[name].values + (law.drag_work.values if name == "damping_work" else 0.0)
            for sign, marker, fill in ((1, "^", color), (-1, "v", "none")):
                group, bounce = np.nonzero(sign * values > 0)
                look = {"color": color, "markerfacecolor": fill, "markersize": 4}
                panel.plot(group + offsets[bounce], np.abs(values[group, bounce]), marker, **look)
        for edge in range(1, law.sizes["steps"]):
            panel.axvline(edge - 0.5, color=style.FAINT, linewidth=0.8)
        panel.grid(axis="x", visible=False)
        panel.set(title=style.law_of(law), ylabel="work in one bounce [J]")
    numbers = zip(books.steps.values, books.omega_h.values, strict=True)
    labels = [f"{steps:,}\nωh = {omega_h:.3g}" for steps, omega_h in numbers]
    panels[-1].set_xticks(range(len(labels)), labels)
    panels[0].set_ylim(SMALLEST, 3 * np.nanmax([np.abs(books[name].values) for name in _WORKS]))
    panels[-1].set_xlim(-0.5, len(labels) - 0.5)
    panels[-1].set_xlabel(
        "number of time steps [1], and ωh; in each group the first bounces from left to right; "
        f"below {readable(SMALLEST)} J not shown"
    )
    handles = [
        *(style.mark(text, "s", color=color) for color, text in _WORKS.values()),
        style.mark("full, up: energy gained", "^", color=style.INK),
        style.mark("open, down: energy lost", "v", color=style.INK, markerfacecolor="none"),
    ]
    style.add_legend(figure, handles)
    return figure


def apex_edge(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return ωh of the last fail of `apex` against the height from which rebounds count, a line for each duration.

    There is a panel for each experiment and contact law.
    """
    columns = style.by_law(experiments.values())
    figure = style.new_figure(title, style.PAGE if len(columns) > 1 else style.COLUMN, 3.0)
    panels = figure.subplots(1, len(columns), sharex=True, sharey=True, squeeze=False)[0]
    for panel, found in zip(panels, columns, strict=True):
        ground = scene_of(found)["ground"]
        numbers = ground_words(stiffness=ground["stiffness"], damping=ground["damping"])
        panel.set_title(f"{style.law_of(found)}, {numbers}")
        heights = found.hop_height.values
        looks = style.ordered(found.sizes["duration"])
        for look, seconds, last in zip(looks, found.duration.values, found.last_fail.values, strict=True):
            panel.plot(heights, last, **look, markersize=3, label=f"runs of {seconds:g} s")
        panel.plot(heights, found.predicted, label="theory: largest gain × R(H)", **style.THEORY)
        panel.set(xscale="log", yscale="log", ylim=(0.2, 2.0), xlabel="rebounds count from this height on [m]")
        style.plain_log_ticks(panel.yaxis, (1.0, 1.5, 2.0, 3.0, 5.0, 7.0))
    panels[0].set_ylabel("ωh of the last fail [1]")
    style.add_legend(figure, panels[0].get_lines())
    return figure
