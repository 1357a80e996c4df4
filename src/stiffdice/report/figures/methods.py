"""Figures that compare methods: work and precision, and an engine's bounce, throw and speed beside the schemes'."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, NullFormatter

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import Array
from stiffdice.experiments.engines import OUTCOMES
from stiffdice.experiments.work_precision.problems import PROBLEMS
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.report.number_format import ground_words, readable
from stiffdice.report.tables.methods import ERRORS, OFF, Found, engines_note, found_in, limit_of, name_of, within
from stiffdice.simulation.engines.registry import METHODS, PEERS

# Panels side by side at most: methods, or stiffnesses from the softest to the stiffest.
_COLUMNS = 3
_ERROR_LABELS = {
    "position": "position error, RMS [r]",
    "restitution": "error of the restitution [1]",
    "energy": "error of the energy at the end [E₀]",
}
_BOUND_LABELS = {1e-2: "1 %", 1e-3: "10⁻³", 1e-6: "10⁻⁶"}
# Errors above are drawn at the upper edge: such a run has nothing to do with the reference any more.
_WORST = 10.0
# The scheme whose cost the √S law is drawn through, at the softest ground.
_LAW_OF = "symplectic_euler"
_LAW: dict[str, Any] = {"color": style.INK, "linestyle": ":", "linewidth": 1.0}
_MORE: dict[str, Any] = {"marker": r"$\uparrow$", "markersize": 6}

# Restitutions above are given by an arrow.
_HIGHEST = 3.2
_STAYS: dict[str, Any] = {"marker": "x", "markersize": 3.5, "color": style.INK}

_COLORS = (style.BLUE, style.ORANGE)
_HATCH = "////"

# Distances below are drawn as this, those above mean nothing more [m].
_SPAN = 1e-12, 1e1
_REFERENCE: dict[str, Any] = {"color": style.INK, "linewidth": 2.5, "alpha": 0.35}


def look_of(method: str) -> dict[str, Any]:
    """Return colour, mark and line of a method: our schemes full, engines and solvers dashed."""
    dashes = "--" if method in PEERS else "-"
    mark = style.METHOD_LOOKS.get(method, {"color": style.QUIET, "marker": "."})
    return mark | {"linestyle": dashes, "linewidth": 0.9, "markersize": 4.5 if method == "exact" else 3}


def _lines(methods: Iterable[str]) -> list[Line2D]:
    """Return a legend's lines."""
    return [style.line(name_of(method), **look_of(method)) for method in methods]


def _errors(data: Mapping[str, xr.Dataset], title: str, measure: str) -> Figure:
    """Return errors against cost, a row for each problem and a column for some stiffnesses."""
    rows = found_in(data.values())
    columns = min(_COLUMNS, max(found.data.sizes["stiffness"] for found in rows))
    figure, panels = _grid(title, rows, columns, sharex="row")
    for line, found in zip(panels, rows, strict=True):
        shown = np.linspace(0, found.data.sizes["stiffness"] - 1, columns).round().astype(int)
        costs = found.data.evaluations.values if found.seconds is None else found.seconds
        for panel, stiffness in zip(line, shown.tolist(), strict=True):
            here = found.data.isel(stiffness=stiffness)
            low, high = here.floor.values[:, meanings_of(here.measure).index(measure)].tolist()
            errors = here[f"{measure}_error"].values
            # Errors of nothing are drawn at a tenth of the floor, or of the least error found.
            lowest = float(np.min(errors[errors > 0], initial=low)) / 10
            errors = np.clip(np.where(np.isnan(errors), np.inf, errors), lowest, _WORST)
            for k, method in enumerate(found.methods):
                drawn = (here.evaluations.values[k] > 0) & np.isfinite(costs[stiffness, k])
                full = np.ones_like(drawn) if found.itself is None else found.itself[stiffness, k]
                _draw_method(panel, method, costs[stiffness, k][drawn], errors[k][drawn], full[drawn])
            panel.axhspan(low, high, color=style.QUIET, alpha=0.25, linewidth=0)
            panel.axhline(low, color=style.QUIET, linewidth=0.8)
            panel.set_ylim(lowest / 2, 2 * _WORST)
            panel.set_title(f"{PROBLEMS[found.problem].name}\n{ground_words(stiffness=float(here.stiffness))}")
            panel.set_xlabel("force evaluations [1]" if found.seconds is None else "median wall time [s]")
        line[0].set_ylabel(_ERROR_LABELS[measure])
    more = [style.area("round-off: in the launch (line) … in a contact's depth", style.QUIET, alpha=0.25)]
    if any(found.seconds is not None for found in rows):
        more.append(_hollow("time per step × steps"))
    _legend(figure, rows, more, engines_note(found.data for found in rows))
    return figure


def _costs(data: Mapping[str, xr.Dataset], title: str, measure: str) -> Figure:
    """Return Figure 13 asked again: costs against stiffness, a row for each problem and a column for each error."""
    rows = found_in(data.values())
    figure, panels = _grid(title, rows, len(ERRORS), sharex=True)
    for line, found in zip(panels, rows, strict=True):
        stiffness, timed = found.data.stiffness.values, found.seconds is not None
        for panel, bound in zip(line, ERRORS, strict=True):
            for method in found.methods:
                costs = [found.cost(method, i, measure, bound, timed=timed) for i in range(len(stiffness))]
                values, reached, tried = map(np.array, zip(*costs, strict=True))
                _draw_method(panel, method, stiffness, values, reached)
                beyond, known = np.isnan(values), np.flatnonzero(np.isfinite(values))
                panel.plot(stiffness[beyond], tried[beyond], **look_of(method) | _MORE | {"linestyle": "none"})
                if method == _LAW_OF and known.size:
                    law = values[known[0]] * np.sqrt(stiffness / stiffness[known[0]])
                    panel.plot(stiffness, law, zorder=1, **_LAW)
            panel.set_title(f"{PROBLEMS[found.problem].name}\n{measure} to {_BOUND_LABELS[bound]}")
        line[0].set_ylabel("wall time [s]" if timed else "force evaluations [1]")
    for panel in panels[-1]:
        panel.set_xlabel(style.STIFFNESS)
    paper = style.line("the paper's law: ∝ √S", **_LAW)
    more = style.mark("more than this, tried in vain", color=style.QUIET, **_MORE)
    _legend(figure, rows, [paper, _hollow("ladder continued", markersize=4), more])
    return figure


# In this order the catalogue names them.
position, restitution, energy = (partial(_errors, measure=measure) for measure in _ERROR_LABELS)
cost_position, cost_restitution, cost_energy = (partial(_costs, measure=measure) for measure in _ERROR_LABELS)


def _grid(title: str, rows: list[Found], columns: int, sharex: Any) -> tuple[Figure, Any]:
    figure = style.new_figure(title, style.PAGE, 2.1 * len(rows) + 1.4)
    panels = figure.subplots(len(rows), columns, sharex=sharex, sharey="row", squeeze=False)
    for panel in panels.flat:
        panel.set(xscale="log", yscale="log")
    return figure, panels


def _legend(figure: Figure, rows: list[Found], more: Iterable[Any], note: str | None = None) -> None:
    names = dict.fromkeys(name for found in rows for name in found.methods)
    handles = [*_lines(names), *more]
    style.add_legend(figure, handles, note or "")


def _hollow(label: str, **look: Any) -> Any:
    return style.mark(f"hollow: {label}", "o", markerfacecolor="none", color=style.QUIET, **look)


def _draw_method(panel: Any, method: str, x: Array, y: Array, full: npt.NDArray[np.bool_]) -> None:
    """Draw a method's line, its marks full or hollow."""
    look = look_of(method)
    panel.plot(x, y, markevery=0, label=method, **look | {"marker": ""})
    panel.plot(x[full], y[full], **look | {"linestyle": "none"})
    panel.plot(x[~full], y[~full], **look | {"linestyle": "none", "markerfacecolor": "none"})


def engine_limits(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return restitution, from the least to the most over the phases, against ωh; a panel for each method."""
    (found,) = experiments.values()
    names = meanings_of(found.method)
    lines = math.ceil(len(names) / _COLUMNS)
    figure = style.new_figure(title, style.PAGE, 1.5 * lines + 1.5)
    panels = figure.subplots(lines, _COLUMNS, sharex=True, sharey=True, squeeze=False)
    for k, (name, panel) in enumerate(zip(names, panels.flat, strict=False)):
        _bounce(panel, found.isel(method=k), limit_of(found.omega_h.values, within(found, k, OFF[-1])).passes)
        panel.set_title(name_of(name))
    for panel in panels.flat[len(names) :]:
        panel.set_axis_off()
    for panel in panels.flat[max(0, len(names) - _COLUMNS) : len(names)]:
        panel.set_xlabel("ωh [1]")
        panel.tick_params(labelbottom=True)
    for panel in panels[:, 0]:
        panel.set_ylabel("restitution e [1]")
    handles = [
        style.area("least to most over the phases of the step at touch-down", style.BLUE, alpha=0.35),
        style.line("exact", **style.THEORY),
        style.area(f"within {OFF[-1]:.0%} of it", style.FAINT),
        style.line("all phases within, up to here", color=style.GREEN),
        style.line("ωh = 2: symplectic Euler's limit of stability", color=style.VERMILION, linestyle=":"),
        style.mark("at some phase it does not leave the ground", **_STAYS),
    ]
    style.add_legend(figure, handles)
    style.add_note(figure, engines_note([found]))
    return figure


def _bounce(panel: Any, found: xr.Dataset, limit: float) -> None:
    omega_h, restitution = found.omega_h.values, found.restitution.values
    exact = float(found.exact_restitution)
    # Over the phases at which it leaves; not-a-number where it does at none.
    low, high = np.fmin.reduce(restitution, axis=1), np.fmax.reduce(restitution, axis=1)
    panel.set_xscale("log")
    panel.axhspan(exact * (1 - OFF[-1]), exact * (1 + OFF[-1]), color=style.FAINT, alpha=0.7, linewidth=0)
    panel.axhline(exact, **style.THEORY)
    panel.axvline(linear_theory.STABILITY_LIMIT, color=style.VERMILION, linewidth=1.0, linestyle=":")
    panel.fill_between(omega_h, low, high, color=style.BLUE, alpha=0.35, linewidth=0)
    for edge in (low, high):
        panel.plot(omega_h, edge, color=style.BLUE, linewidth=1.0)
    stays = (found.outcome.values != OUTCOMES.index("leaves")).any(axis=1)
    panel.plot(omega_h, np.where(stays, 0.0, np.nan), linestyle="none", **_STAYS)
    if limit < omega_h[-1]:
        panel.axvline(limit, color=style.GREEN, linewidth=1.2)
    top = float(np.nanmax(high))
    if top > _HIGHEST:
        style.write_in_corner(panel, 0.03, f"↑ to e = {top:.3g}\nat ωh = {omega_h[int(np.nanargmax(high))]:.3g}")
    panel.set(xlim=omega_h[[0, -1]], ylim=(-0.12, _HIGHEST))
    panel.xaxis.set_major_locator(FixedLocator([0.02, 0.1, 0.5, 2, 10]))
    panel.xaxis.set_major_formatter("{x:g}")
    panel.xaxis.set_minor_formatter(NullFormatter())


def engine_throw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return three panels: height, distance over time, distance over effort."""
    (found,) = experiments.values()
    names = meanings_of(found.method)
    figure = style.new_figure(title, style.PAGE, 3.4)
    left, middle, right = figure.subplots(1, 3, width_ratios=[1.0, 1.25, 1.0])
    height = found.reference_position.values[:, 2]
    left.plot(found.time, height, **_REFERENCE)
    own = np.maximum(found.reference_error, _SPAN[0])
    middle.fill_between(found.time, _SPAN[0], own, color=style.FAINT, linewidth=0)
    # The sample at which the first rebound is over: the first apex after the first landing.
    changes, last = np.diff(np.sign(np.diff(height))), len(height) - 1
    landings, apexes = np.flatnonzero(changes > 0) + 1, np.flatnonzero(changes < 0) + 1
    contact = int(apexes[apexes > landings.min(initial=last)].min(initial=last))
    distance, efforts = np.clip(found.distance.values, *_SPAN), []
    for k, name in enumerate(names):
        look = look_of(name)
        left.plot(found.time, found.position.values[k, -1, :, 2], **look | {"marker": ""})
        middle.plot(found.time[1:], distance[k, -1, 1:], markevery=0.1, **look)
        right.plot(found.evaluations[k], distance[k, :, contact], **look)
        steps, tolerance = int(found.steps[k, -1]), float(found.tolerance[k, -1])
        effort = f"{readable(steps)} steps" if steps else f"tolerance {readable(tolerance)}"
        efforts.append(f"{name_of(name)} {effort}")
    left.set(xlabel="time [s]", ylabel="height of the centre [m]", title="height, at the most effort")
    span = np.ptp(height)
    left.set_ylim(height.min() - 0.1 * span, height.max() + 0.15 * span)
    middle.set(yscale="log", ylim=_SPAN, xlabel="time [s]", ylabel="distance from the reference [m]")
    middle.set_title("distance, at the most effort\n(grey: the reference's own)")
    right.set(xscale="log", yscale="log", xlabel="force evaluations [1]", ylabel="distance from the reference [m]")
    right.set_title(f"after the first landing, t = {float(found.time[contact]):.2f} s")
    reference = style.line(f"reference: {found.attrs['reference']}", **_REFERENCE)
    style.add_legend(figure, [reference, *_lines(names)])
    unfit = found.attrs.get("unfit", "")
    parts = [f"At the most: {', '.join(efforts)}.", engines_note([found]), f"Cannot: {unfit}." if unfit else ""]
    style.add_note(figure, " ".join(parts).strip())
    return figure


def engine_speed(timings: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return bars."""
    (found,) = timings.values()
    names, problems = meanings_of(found.method), meanings_of(found.problem)
    rates = found.taken.values / found.seconds.values
    order = np.argsort(np.nan_to_num(np.nanmax(rates, axis=0)))
    figure = style.new_figure(title, height=0.32 * len(names) + 2.0)
    panel = figure.subplots()
    thick = 0.8 / len(problems)
    hatches = [_HATCH if METHODS[names[k]].own_steps else None for k in order]
    for p, color in zip(range(len(problems)), _COLORS, strict=False):
        across = np.arange(len(names)) + (len(problems) - 1 - 2 * p) / 2 * thick
        look: dict[str, Any] = {"color": color, "edgecolor": style.PAPER, "linewidth": 0.5, "hatch": hatches}
        bars = panel.barh(across, rates[p, order], thick, **look)
        texts = ["" if np.isnan(rate) else readable(rate, digits=2) for rate in rates[p, order]]
        panel.bar_label(bars, texts, padding=2, fontsize=style.SMALL)
    panel.set_yticks(range(len(names)), [name_of(names[k]) for k in order])
    panel.set(xscale="log", xlabel="steps a second [1/s]", xlim=(np.nanmin(rates) / 3, np.nanmax(rates) * 5))
    panel.grid(visible=False, axis="y")
    handles = [style.area(PROBLEMS[name].name, color) for color, name in zip(_COLORS, problems, strict=True)]
    own: dict[str, Any] = {"facecolor": style.PAPER, "edgecolor": style.QUIET, "hatch": _HATCH}
    handles.append(Patch(label="force evaluations: takes its own steps", **own))
    style.add_legend(figure, handles)
    machine = f"One thread of {found.attrs['machine_processor']}, medians of warm runs."
    style.add_note(figure, f"{machine} {engines_note([found])}")
    return figure
