"""The throw in every engine: height, distance from the reference over time, and how it falls with effort."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import method_looks, style
from stiffdice.report.methods import engines_note, name_of
from stiffdice.report.number_format import readable

# Distances below are drawn as this, those above mean nothing more [m].
_SPAN = 1e-12, 1e1
_REFERENCE: dict[str, Any] = {"color": style.INK, "linewidth": 2.5, "alpha": 0.35}


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return three panels; experiments: one, as `experiments.engine_throw.measure` makes it."""
    (found,) = experiments.values()
    names = meanings_of(found.method)
    figure = style.new_figure(title, width=12.5, height=4.6)
    left, middle, right = figure.subplots(1, 3, width_ratios=[1.0, 1.25, 1.0])
    contact = _first_contact(found)
    _heights(left, found, names)
    _distances(middle, found, names)
    _efforts(right, found, names, contact)
    reference = style.line(f"reference:\n{found.attrs['reference']}", **_REFERENCE)
    figure.legend(handles=[reference, *method_looks.handles(names)], loc="outside right center")
    unfit = found.attrs.get("unfit", "")
    note = " ".join([_steps(found, names), engines_note([found]), f"Cannot: {unfit}." if unfit else ""])
    style.add_note(figure, note.strip())
    return figure


def _first_contact(found: xr.Dataset) -> int:
    """Return the sample at which the first rebound is over: half way between the first landing and the next apex."""
    height = found.reference_position.values[:, 2]
    falls = np.flatnonzero((height[1:-1] < height[:-2]) & (height[1:-1] <= height[2:]))
    low = int(falls[0]) + 1 if falls.size else len(height) - 1
    later = np.flatnonzero((height[low + 1 : -1] > height[low:-2]) & (height[low + 1 : -1] >= height[low + 2 :]))
    return low + 1 + int(later[0]) if later.size else len(height) - 1


def _heights(panel: Any, found: xr.Dataset, names: list[str]) -> None:
    panel.plot(found.time, found.reference_position.values[:, 2], **_REFERENCE)
    for k, name in enumerate(names):
        panel.plot(found.time, found.position.values[k, -1, :, 2], **method_looks.look(name) | {"marker": ""})
    panel.set(xlabel="time [s]", ylabel="height of the centre [m]")
    panel.set_title("height, at the most effort")
    low, high = np.nanmin(found.reference_position.values[:, 2]), np.nanmax(found.reference_position.values[:, 2])
    panel.set_ylim(low - 0.1 * (high - low), high + 0.15 * (high - low))


def _distances(panel: Any, found: xr.Dataset, names: list[str]) -> None:
    panel.set_yscale("log")
    own = np.maximum(found.reference_error, _SPAN[0])
    panel.fill_between(found.time, _SPAN[0], own, color=style.FAINT, linewidth=0)
    for k, name in enumerate(names):
        distance = found.distance.values[k, -1]
        panel.plot(found.time[1:], np.clip(distance[1:], *_SPAN), markevery=0.1, **method_looks.look(name))
    panel.set(xlabel="time [s]", ylabel="distance from the reference [m]")
    panel.set_ylim(_SPAN)
    panel.set_title("distance, at the most effort (grey: the reference's own)")


def _efforts(panel: Any, found: xr.Dataset, names: list[str], contact: int) -> None:
    panel.set(xscale="log", yscale="log")
    for k, name in enumerate(names):
        distance = np.clip(found.distance.values[k, :, contact], *_SPAN)
        panel.plot(found.evaluations[k], distance, **method_looks.look(name))
    panel.set(xlabel="force evaluations [1]", ylabel="distance from the reference [m]")
    panel.set_title(f"after the first landing, t = {float(found.time[contact]):.2f} s")


def _steps(found: xr.Dataset, names: list[str]) -> str:
    efforts = []
    for k, name in enumerate(names):
        steps, tolerance = int(found.steps[k, -1]), float(found.tolerance[k, -1])
        effort = f"{readable(steps)} steps" if steps else f"tolerance {readable(tolerance)}"
        efforts.append(f"{name_of(name)} {effort}")
    return f"At the most: {', '.join(efforts)}."
