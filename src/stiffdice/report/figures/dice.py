"""Dice of any shape and load: which face comes up, beside models and measurements; and how far that is a law."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffdice.report.figures import style
from stiffdice.report.number_format import scene_of

_MODELS: dict[str, tuple[str, dict[str, Any]]] = {
    "solid_angle": ("solid angle", {"color": style.INK, "linestyle": ":"}),
    "gibbs": ("Gibbs (Riemer, Stoyan, Obreschkow), β fitted", {"color": style.PURPLE, "linestyle": "--"}),
    "pender_uhrin": ("Pender and Uhrin's 2-D formula", {"color": style.GREEN, "linestyle": "-."}),
}
_ENDS, _ASPECT = "part on one of the two square ends [1]", "c/a [1]"
_CHI = "χ = d ln p(end pair)/d ln(c/a) [1]"
_PSI = "ψ = d ln(p/p opposite)/d(offset/side) [1]"
_SOLID_ANGLE = -1.1027


def ends(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return how often square boxes land on an end against c/a, on a plain and on a logarithmic axis."""
    (found,) = experiments.values()
    figure = style.new_figure(title, style.PAGE, 3.3)
    for panel, scale in zip(figure.subplots(1, 2), ("linear", "log"), strict=True):
        _draw_ends(panel, found)
        panel.set(xscale="log", xlabel=_ASPECT, ylabel=_ENDS, yscale=scale)
        style.plain_log_ticks(panel.xaxis, (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0))
        if scale == "log":
            panel.set_ylim(2e-4, 1.3)
    low, high = (_ends_of(found[name].values) for name in ("restitution", "friction"))
    handles = [
        style.line(
            f"simulated, e = {float(found.gibbs_restitution):g}, μ = {float(found.gibbs_friction):g}", color=style.BLUE
        ),
        style.area(f"simulated, e = {low}, μ = {high}", style.BLUE, alpha=0.2),
        *(style.line(words, **look) for words, look in _MODELS.values()),
    ]
    if "specimen" in found.dims:
        handles.append(
            style.mark("steel dice (Mungan and Lipscombe, table 1)", "o", color=style.VERMILION, markersize=4)
        )
    style.add_legend(figure, handles)
    return figure


def _ends_of(values: Any) -> str:
    return f"{values.min():g} to {values.max():g}"


def _draw_ends(panel: Any, found: xr.Dataset) -> None:
    aspect = found.aspect.values
    grounds = found.end_pair.stack(ground=("restitution", "friction"))
    panel.fill_between(aspect, grounds.min("ground"), grounds.max("ground"), color=style.BLUE, alpha=0.2, linewidth=0)
    ground = {"restitution": float(found.gibbs_restitution), "friction": float(found.gibbs_friction)}
    there = found.sel(ground)
    panel.errorbar(aspect, there.end_pair, there.end_pair_error, color=style.BLUE, linewidth=1.4)
    for name, (_, look) in _MODELS.items():
        panel.plot(aspect, found[name], **look)
    if "specimen" in found.dims:
        part, throws = found.measured_part.values, found.measured_throws.values
        error = np.sqrt(part * (1 - part) / throws)
        look = {"color": style.VERMILION, "fmt": "o", "markersize": 3.5, "linewidth": 0.9, "zorder": 4}
        panel.errorbar(found.measured_aspect, part, error, **look)
    panel.axvline(1, color=style.QUIET, linewidth=0.6)
    panel.axhline(1 / 3, color=style.QUIET, linewidth=0.6)


def response(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return χ and ψ against friction, for each restitution and each way of throwing."""
    figure = style.new_figure(title, style.PAGE, 3.4)
    panels = figure.subplots(1, 2)
    handles, lines = [], ("-", "--", ":", "-.")
    for k, (name, found) in enumerate(experiments.items()):
        look = style.SERIES[k % len(style.SERIES)]
        for restitution, line in zip(found.restitution.values, lines, strict=False):
            there = found.sel(restitution=restitution)
            shown = zip(panels, ("chi", "psi"), strict=True)
            for panel, coefficient in shown:
                _with_errors(panel, there, "friction", coefficient, look | {"linestyle": line})
        handles.append(style.line(f"{name}: {_launch(found)}", markersize=3, **look))
    first = next(iter(experiments.values()))
    handles += [
        style.line(f"e = {e:g}", color=style.QUIET, linestyle=line)
        for e, line in zip(first.restitution.values, lines, strict=False)
    ]
    for panel in panels:
        panel.set_xticks(first.friction.values, [f"{mu:g}" for mu in first.friction.values])
    _finish(panels, "friction coefficient μ [1]")
    style.add_legend(figure, handles)
    return figure


def launches(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return χ and ψ against the spread of the spin, for each speed of the launch."""
    (found,) = experiments.values()
    figure = style.new_figure(title, style.PAGE, 3.1)
    panels = figure.subplots(1, 2)
    handles = []
    for look, speed in zip(style.ordered(found.sizes["speed"]), found.speed.values, strict=True):
        for panel, coefficient in zip(panels, ("chi", "psi"), strict=True):
            _with_errors(panel, found.sel(speed=speed), "spin", coefficient, look)
        handles.append(style.line(f"{speed:g} m/s", markersize=3, **look))
    for panel in panels:
        panel.set_xscale("log")
        panel.minorticks_off()
        panel.set_xticks(found.spin.values, [f"{spin:g}" for spin in found.spin.values])
    _finish(panels, "spread of each component of the spin [rad/s]")
    style.add_legend(figure, handles, "mean speed along the ground")
    style.add_note(
        figure, f"e = {found.attrs['restitution']:g}, μ = {found.attrs['friction']:g}; bars: standard errors"
    )
    return figure


def _with_errors(panel: Any, found: xr.Dataset, axis: str, name: str, look: Mapping[str, Any]) -> None:
    panel.errorbar(found[axis], found[name], found[f"{name}_error"], markersize=3, linewidth=0.9, capsize=1.5, **look)


def _finish(panels: Any, label: str) -> None:
    for panel, words in zip(panels, (_CHI, _PSI), strict=True):
        panel.set(xlabel=label, ylabel=words)
    panels[0].axhline(_SOLID_ANGLE, **style.THEORY)
    style.write_beside(panels[0], f"solid angle: −{-_SOLID_ANGLE:.2f}", (panels[0].get_xlim()[0], _SOLID_ANGLE), (4, 4))
    panels[1].set_ylim(top=0)


def _launch(found: xr.Dataset) -> str:
    """Return how a die was thrown, in a few words with units."""
    x, y, z = scene_of(found)["launch"]["velocity"]
    speed = float(np.sqrt(x * x + y * y + z * z))
    velocity, spin = found.attrs["velocity_spread"], found.attrs["spin_spread"]
    return f"{speed:g} ± {velocity:g} m/s, spin 0 ± {spin:g} rad/s"
