"""A cube at rest: which contact mode limits the step size, and what becomes of a nudge below and above the limit."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from stiffdice.dynamics import linear_theory
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.report.number_format import ground_words, readable, scene_of

# One look for each contact mode, smaller from one to the next: all that lie on one point show.
_LOOKS: dict[str, dict[str, Any]] = {
    "face_bounce": {"color": style.BLUE, "marker": "o", "markersize": 12.0},
    "face_rocking": {"color": style.VERMILION, "marker": "s", "markersize": 8.0},
    "edge": {"color": style.GREEN, "marker": "D", "markersize": 5.0},
    "corner": {"color": style.INK, "marker": "^", "markersize": 3.0},
}
# A pale mark within an outline: two inertias at one point show, too.
_FILLS: dict[str, dict[str, Any]] = {
    "corners": {"alpha": 0.3, "markeredgewidth": 0, "zorder": 2.5},
    "solid": {"markerfacecolor": "none", "markeredgewidth": 1.0, "zorder": 3},
}


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return limits against damping, the longest step of each mode, and the growth of a nudge around the limit."""
    (dataset,) = experiments.values()
    figure = style.new_figure(title, width=11.4, height=4.7)
    left, middle, right = figure.subplots(1, 3)
    _limits(left, dataset)
    _longest_steps(middle, dataset)
    _growths(right, dataset)
    figure.legend(handles=_legend(), loc="outside lower center", ncols=7)
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
    panel.set_title("One limit in units of each mode's own ω")
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
        color = _LOOKS[meanings_of(dataset.mode)[worst]]["color"]
        panel.axhline(at, color=color, linewidth=0.8, linestyle=":", zorder=1)
        text = f"{inertia}: limited by {modes[worst]}, {at:.3f}"
        style.write_beside(panel, text, (len(modes) - 0.45, at), (0, -6), ha="right", va="top")
    for (i, inertia), (k, mode) in _named(dataset.inertia, dataset.mode):
        panel.plot([k - 0.25, k + 0.25], [predicted[i, k]] * 2, **style.THEORY)
        _marks(panel, [k], [steps[i, k]], mode, inertia, size=8)
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
            size = 5 + 2 * (nudge == "bounce")
            _marks(panel, scan, dataset.growth.values[i, k, z], f"face_{nudge}", inertia, size=size)
        style.write_beside(panel, f"ζ = {zeta:g}", (fine[-1], growth[-1]), (-14, 0), ha="right")
    stiffness = scene_of(dataset)["ground"]["stiffness"]
    style.write_in_corner(panel, 0.04, f"{ground_words(stiffness=stiffness)}\ngated, no friction")
    panel.set_title("A nudge to the cube at rest on its face")
    panel.set(xlabel="ωh over its limit [1]", ylabel="growth of the nudge in a step [1]")


def _marks(
    panel: Any, x: npt.ArrayLike, y: npt.ArrayLike, mode: str, inertia: str, *, size: float | None = None
) -> None:
    look = _LOOKS[mode] | ({} if size is None else {"markersize": size})
    panel.plot(x, y, linestyle="none", label=f"{mode} {inertia}", **look, **_FILLS[inertia])


def _legend() -> list[Any]:
    return [
        *(style.mark(mode.replace("_", " "), **look, **_FILLS["solid"]) for mode, look in _LOOKS.items()),
        Patch(facecolor="none", edgecolor=style.INK, label="outline: solid inertia"),
        style.area("filled: corners inertia", style.INK, alpha=0.3),
        style.line("theory", **style.THEORY),
    ]
