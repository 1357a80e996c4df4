"""The throw in every engine: height, distance from the reference over time, and how it falls with effort."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffdice.dynamics.state import Array
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import method_style, style
from stiffdice.report.methods import engines_note, name_of
from stiffdice.report.number_format import readable

# Distances below are drawn as this, those above mean nothing more [m].
_SPAN = 1e-12, 1e1
_REFERENCE: dict[str, Any] = {"color": style.INK, "linewidth": 2.5, "alpha": 0.35}


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return three panels: height, distance over time, distance over effort."""
    (found,) = experiments.values()
    names = meanings_of(found.method)
    figure = style.new_figure(title, width=12.5, height=4.6)
    left, middle, right = figure.subplots(1, 3, width_ratios=[1.0, 1.25, 1.0])
    height = found.reference_position.values[:, 2]
    left.plot(found.time, height, **_REFERENCE)
    own = np.maximum(found.reference_error, _SPAN[0])
    middle.fill_between(found.time, _SPAN[0], own, color=style.FAINT, linewidth=0)
    contact = _first_contact(height)
    distance = np.clip(found.distance.values, *_SPAN)
    for k, name in enumerate(names):
        look = method_style.look(name)
        left.plot(found.time, found.position.values[k, -1, :, 2], **look | {"marker": ""})
        middle.plot(found.time[1:], distance[k, -1, 1:], markevery=0.1, **look)
        right.plot(found.evaluations[k], distance[k, :, contact], **look)
    left.set(xlabel="time [s]", ylabel="height of the centre [m]", title="height, at the most effort")
    span = np.ptp(height)
    left.set_ylim(height.min() - 0.1 * span, height.max() + 0.15 * span)
    middle.set(yscale="log", ylim=_SPAN, xlabel="time [s]", ylabel="distance from the reference [m]")
    middle.set_title("distance, at the most effort (grey: the reference's own)")
    right.set(xscale="log", yscale="log", xlabel="force evaluations [1]", ylabel="distance from the reference [m]")
    right.set_title(f"after the first landing, t = {float(found.time[contact]):.2f} s")
    reference = style.line(f"reference:\n{found.attrs['reference']}", **_REFERENCE)
    figure.legend(handles=[reference, *method_style.handles(names)], loc="outside right center")
    unfit = found.attrs.get("unfit", "")
    note = " ".join([_steps(found, names), engines_note([found]), f"Cannot: {unfit}." if unfit else ""])
    style.add_note(figure, note.strip())
    return figure


def _first_contact(height: Array) -> int:
    """Return the sample at which the first rebound is over: the first apex after the first landing."""
    changes = np.diff(np.sign(np.diff(height)))
    landings, apexes = np.flatnonzero(changes > 0) + 1, np.flatnonzero(changes < 0) + 1
    last = len(height) - 1
    return int(apexes[apexes > landings.min(initial=last)].min(initial=last))


def _steps(found: xr.Dataset, names: list[str]) -> str:
    efforts = []
    for k, name in enumerate(names):
        steps, tolerance = int(found.steps[k, -1]), float(found.tolerance[k, -1])
        effort = f"{readable(steps)} steps" if steps else f"tolerance {readable(tolerance)}"
        efforts.append(f"{name_of(name)} {effort}")
    return f"At the most: {', '.join(efforts)}."
