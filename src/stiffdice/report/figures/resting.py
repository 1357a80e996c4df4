"""Contacts that last: a cube at rest and what becomes of a nudge, its chatter, and corners held by friction."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter

from stiffdice.dynamics import linear_theory
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.report.number_format import ground_words, readable, scene_of

# One look for each contact mode, smaller from one to the next: all that lie on one point show.
_MODES: dict[str, dict[str, Any]] = {
    "face_bounce": {"color": style.BLUE, "marker": "o", "markersize": 9.0},
    "face_rocking": {"color": style.VERMILION, "marker": "s", "markersize": 6.5},
    "edge": {"color": style.GREEN, "marker": "D", "markersize": 4.0},
    "corner": {"color": style.INK, "marker": "^", "markersize": 2.5},
}
# A pale mark within an outline: two inertias at one point show, too.
_FILLS: dict[str, dict[str, Any]] = {
    "corners": {"alpha": 0.3, "markeredgewidth": 0, "zorder": 2.5},
    "solid": {"markerfacecolor": "none", "markeredgewidth": 1.0, "zorder": 3},
}


def rocking(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return limits against damping, the longest step of each mode, and the growth of a nudge around the limit."""
    (dataset,) = experiments.values()
    figure = style.new_figure(title, style.PAGE, 3.9)
    left, middle, right = figure.subplots(1, 3)
    _limits(left, dataset)
    _longest_steps(middle, dataset)
    _growths(right, dataset)
    handles = [
        *(style.mark(mode.replace("_", " "), **look, **_FILLS["solid"]) for mode, look in _MODES.items()),
        Patch(facecolor="none", edgecolor=style.INK, label="outline: solid inertia"),
        style.area("filled: corners inertia", style.INK, alpha=0.3),
        style.line("theory", **style.THEORY),
    ]
    style.add_legend(figure, handles)
    return figure


def _limits(panel: Any, dataset: xr.Dataset) -> None:
    zeta = dataset.zeta.values
    fine = np.linspace(0, zeta.max(), 201)
    panel.plot(fine, [linear_theory.stability_limit(value) for value in fine], **style.THEORY)
    for (i, inertia), (k, mode) in _named(dataset.inertia, dataset.mode):
        _marks(panel, zeta, dataset.limit.values[i, k], mode, inertia)
    theory = np.array([linear_theory.stability_limit(value) for value in zeta])
    error = readable(np.abs(dataset.limit.values / theory - 1).max(), digits=2)
    style.write_in_corner(panel, 0.98, f"theory: 2(√(1 + ζ²) − ζ)\nlargest relative difference: {error}")
    panel.set_title("One limit in units\nof each mode's own ω")
    panel.set(xlabel="damping ratio ζ of the mode [1]", ylabel="measured limit ωh [1]")


def _named(*enums: xr.DataArray) -> Iterator[tuple[tuple[int, str], ...]]:
    """Yield all combinations of enums' values, each with its number."""
    return itertools.product(*(enumerate(meanings_of(part)) for part in enums))


def _longest_steps(panel: Any, dataset: xr.Dataset) -> None:
    """Draw h √(S/m) at the limit, with the least damping there is, and what theory says of it: limit over √k."""
    least = int(dataset.zeta.values.argmin())
    modes = [mode.replace("_", " ") for mode in meanings_of(dataset.mode)]
    steps, numbers = dataset.longest_step.values[:, :, least], dataset.mode_number_theory.values
    predicted = linear_theory.stability_limit(float(dataset.zeta[least])) / np.sqrt(numbers)
    for i, inertia in enumerate(meanings_of(dataset.inertia)):
        worst, at = int(steps[i].argmin()), steps[i].min()
        color = _MODES[meanings_of(dataset.mode)[worst]]["color"]
        panel.axhline(at, color=color, linewidth=0.8, linestyle=":", zorder=1)
        text = f"{inertia}: limited\nby {modes[worst]}, {at:.3f}"
        # The higher of the two has its words above, where no mark is.
        high = at == steps.min(axis=1).max()
        place, look = ((0.3, at), {"va": "bottom"}) if high else ((len(modes) - 0.45, at), {"ha": "right", "va": "top"})
        style.write_beside(panel, text, place, (0, 1 if high else -6), **look)
    for (i, inertia), (k, mode) in _named(dataset.inertia, dataset.mode):
        panel.plot([k - 0.25, k + 0.25], [predicted[i, k]] * 2, **style.THEORY)
        _marks(panel, [k], [steps[i, k]], mode, inertia, markersize=6)
    # Two inertias with the same k share a label.
    labels = {(k, round(numbers[i, k])): steps[i, k] for i, k in np.ndindex(steps.shape)}
    for (k, number), step in labels.items():
        style.write_beside(panel, f"k = {number}", (k, step), (0, 8), ha="center")
    panel.set_xticks(range(len(modes)), [mode.replace(" ", "\n") for mode in modes])
    panel.set_xlim(-0.5, len(modes) - 0.4)
    panel.set_ylim(min(steps.min() * 0.87, steps.min() - 0.05), steps.max() * 1.1)
    panel.set_title(f"The longest step, at ζ = {float(dataset.zeta[least]):g}")
    panel.set(xlabel="contact mode, ω² = kS/m [rad²/s²]", ylabel="longest stable step h √(S/m) [1]")


def _growths(panel: Any, dataset: xr.Dataset) -> None:
    scan = dataset.omega_h_relative.values
    fine = np.unique(np.concatenate([np.linspace(scan.min(), scan.max(), 401), [1.0]]))
    for z, zeta in enumerate(dataset.nudge_zeta.values):
        limit = linear_theory.stability_limit(zeta)
        growth = [linear_theory.growth(part * limit, zeta) for part in fine]
        panel.plot(fine, growth, **style.THEORY)
        for (i, inertia), (k, nudge) in _named(dataset.inertia, dataset.nudge):
            size = 4 + 1.5 * (nudge == "bounce")
            _marks(panel, scan, dataset.growth.values[i, k, z], f"face_{nudge}", inertia, markersize=size)
        style.write_beside(panel, f"ζ = {zeta:g}", (fine[-1], growth[-1]), (-14, 0), ha="right")
    stiffness = scene_of(dataset)["ground"]["stiffness"]
    style.write_in_corner(panel, 0.04, f"{ground_words(stiffness=stiffness)}\ngated, no friction")
    panel.set_title("A nudge to the cube\nat rest on its face")
    panel.set(xlabel="ωh over its limit [1]", ylabel="growth of the nudge in a step [1]")


def _marks(panel: Any, x: npt.ArrayLike, y: npt.ArrayLike, mode: str, inertia: str, **size: float) -> None:
    panel.plot(x, y, linestyle="none", label=f"{mode} {inertia}", **_MODES[mode] | size, **_FILLS[inertia])


def chatter(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the swing of the sliding speed of a cube at rest against the step size, over theory, for each friction.

    Open marks on the axis are cubes at rest.
    """
    (dataset,) = experiments.values()
    figure = style.new_figure(title, height=3.4)
    panel: Any = figure.subplots()
    sizes, swings = dataset.step_size.values, dataset.swing.values
    least_swing = dataset.swing_theory.values[dataset.swing_theory.values > 0].min()
    lowest = float(10 ** np.floor(np.log10(least_swing) - 0.5))
    panel.set(xscale="log", yscale="log", ylim=(lowest, 3 * swings.max()))
    panel.set(xlabel="step size h [s]", ylabel="largest sliding speed\nof a cube at rest [m/s]")
    looks = style.ordered(dataset.sizes["friction"])
    for k, mu in enumerate(dataset.friction.values):
        color = looks[k]["color"]
        least, rests, size = float(dataset.least_step[k]), swings[k] < lowest, max(2.5, 5.5 - 1.5 * k)
        look: Any = {**looks[k], "linestyle": "none", "markersize": size, "zorder": 3}
        panel.plot(sizes[~rests], swings[k, ~rests], label=ground_words(friction=float(mu)), **look)
        panel.plot(sizes[rests], np.full(rests.sum(), lowest), markerfacecolor="none", clip_on=False, **look)
        if least < sizes.max():
            fine = least * np.geomspace(1 + 1e-9, sizes.max() / least, 1000)
            cutoff = float(dataset.swing_theory[k, -1]) / (sizes[-1] / least - 1)
            panel.plot(fine, cutoff * (fine / least - 1), **style.THEORY)
            look = {"rotation": 90, "ha": "right", "va": "bottom", "color": color}
            style.write_beside(panel, f"{readable(least)} s", (least, lowest), (-2, 12), **look)
    panel.plot([], [], label="theory: μ g h/2 − umin, from h = 2 umin/(μ g) on", **style.THEORY)
    panel.plot([], [], "o", color=style.QUIET, markerfacecolor="none", label="comes to rest", markersize=4)
    style.add_legend(figure, panel.get_legend_handles_labels()[0])
    return figure


def held_contacts(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return a column for each friction: above the error of `event` against its tolerance, below what it costs.

    There is a line for each stiffness. Lines are medians over the launches, dots the worst.
    """
    (dataset,) = experiments.values()
    count, tolerance = dataset.sizes["friction"], dataset.tolerance
    figure = style.new_figure(title, style.PAGE, 4.6)
    rows = figure.subplots(2, count, sharex=True, sharey="row", squeeze=False)
    colors = [look["color"] for look in style.ordered(dataset.sizes["stiffness"])]
    for f, column in enumerate(rows.T):
        there, (upper, lower) = dataset.isel(friction=f), column
        for s, color in enumerate(colors):
            for panel, values in zip(column, (there.error.values, there.evaluations.values), strict=True):
                panel.plot(tolerance, np.nanmedian(values[s], axis=0), color=color, linewidth=1.2)
                worst = np.nanmax(values[s], axis=0)
                panel.plot(tolerance, worst, color=color, linestyle="none", marker=".", markersize=4)
        upper.plot(tolerance, tolerance, **style.THEORY)
        upper.axhline(float(there.reference_error.median()), color=style.QUIET, linestyle=":", linewidth=1.2)
        upper.set(xscale="log", yscale="log", title=ground_words(friction=float(there.friction)))
        lower.set(xscale="log", yscale="log", xlabel="tolerance [1]")
        lower.xaxis.set_major_locator(LogLocator(numticks=4))
        lower.xaxis.set_minor_formatter(NullFormatter())
    rows[0, 0].set_ylabel("error of the position [r]")
    rows[1, 0].set_ylabel("force evaluations [1]")
    rows[0, 0].invert_xaxis()
    grounds = [ground_words(stiffness=value) for value in dataset.stiffness.values.tolist()]
    handles = [
        *(style.line(words, color=color) for words, color in zip(grounds, colors, strict=True)),
        style.mark("worst launch", ".", color=style.INK),
        style.line("the tolerance itself", **style.THEORY),
        style.line("LSODA from LSODA", color=style.QUIET, linestyle=":"),
    ]
    style.add_legend(figure, handles)
    style.add_note(figure, f"lines: medians of {dataset.sizes['launch']} launches; error: distance from LSODA at 1e-13")
    return figure
