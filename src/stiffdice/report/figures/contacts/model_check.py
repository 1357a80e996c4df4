"""The figure of `stiffdice check`: what landings in a MuJoCo model do at which time step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stiffdice.advice.model_check import GAIN, Check, Contact
from stiffdice.report.figures import style

_HIGHEST, _LEAST, _MOST = 1.5, 1e-3, 1e3  # of a restitution that is drawn; of an energy


def draw(check: Check, _: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return restitution and energy against the time step, of the contacts with verdicts first."""
    shown = sorted(check.contacts, key=lambda contact: not contact.verdicts)[: len(style.SERIES)]
    more = len(check.contacts) - len(shown)
    figure = style.new_figure(f"{title}; {more} more not shown" if more else title, style.PAGE, 3.6)
    left, right = figure.subplots(1, 2, sharex=True)
    own = float(check.model.compiled.opt.timestep)
    for contact, look in zip(shown, style.SERIES, strict=False):
        _restitution(left, contact, look)
        steps = [rung.timestep for rung in contact.rungs]
        energy = np.clip([rung.energy for rung in contact.rungs], _LEAST, _MOST)
        right.plot(steps, energy, **look, markersize=3, label=" on ".join(contact.meeting.names))
    right.axhline(GAIN, color=style.INK, linewidth=0.8, linestyle=":", label=f"gains energy above {GAIN:g}")
    for panel in (left, right):
        panel.axvline(own, color=style.QUIET, linewidth=0.8, label=f"the model's own step, {own:g} s")
        panel.set(xscale="log", xlabel="time step [s]")
    left.set(ylabel="restitution e [1]", ylim=(-0.03, _HIGHEST))
    right.set(ylabel="energy after over before [1]", yscale="log")
    handles, _ = right.get_legend_handles_labels()
    told = "e predicted; marks: measured, mean and span over the phase of the step"
    style.add_legend(figure, [*handles, style.line(told, color=style.INK, linestyle="--")])
    return figure


def _restitution(panel: Axes, contact: Contact, look: Mapping[str, Any]) -> None:
    steps = np.array([rung.timestep for rung in contact.rungs])
    low, mean, high = np.clip(np.array([rung.measured for rung in contact.rungs]).T, 0, 10 * _HIGHEST)
    predicted = np.clip([rung.predicted.mean for rung in contact.rungs], 0, 10 * _HIGHEST)
    panel.errorbar(steps, mean, (mean - low, high - mean), **look, markersize=3, linestyle="none")
    panel.plot(steps, predicted, color=look["color"], linewidth=1.0, linestyle="--")
