"""Work and precision: error against cost, and the cost of an error against stiffness; in evaluations, or in seconds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from matplotlib.figure import Figure

from stiffdice.dynamics.state import Array
from stiffdice.experiments.work_precision.problems import PROBLEMS
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import method_style, style
from stiffdice.report.methods import engines_note
from stiffdice.report.number_format import ground_words
from stiffdice.report.tables.work_precision import ERRORS, Found, found_in

# So many stiffnesses are drawn at most, from the softest to the stiffest.
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
_MORE: dict[str, Any] = {"marker": r"$\uparrow$", "markersize": 9}


def _errors(data: Mapping[str, xr.Dataset], title: str, measure: str) -> Figure:
    """Return errors against cost, a row for each problem and a column for some stiffnesses."""
    rows = found_in(data.values())
    columns = min(_COLUMNS, max(found.data.sizes["stiffness"] for found in rows))
    figure, panels = _grid(title, rows, columns, sharex="row")
    for line, found in zip(panels, rows, strict=True):
        shown = np.linspace(0, found.data.sizes["stiffness"] - 1, columns).round().astype(int)
        for panel, stiffness in zip(line, shown, strict=True):
            _errors_panel(panel, found, int(stiffness), measure)
        line[0].set_ylabel(_ERROR_LABELS[measure])
    grey = style.area("round-off: in the launch (line) … in a contact's depth", style.QUIET, alpha=0.25)
    handles = [grey, *([_hollow("time per step × steps")] if any(found.seconds is not None for found in rows) else [])]
    note = engines_note(found.data for found in rows)
    _legend(figure, rows, handles, **({"title": note, "title_fontsize": 7.5} if note else {}))
    return figure


def _costs(data: Mapping[str, xr.Dataset], title: str, measure: str) -> Figure:
    """Return Figure 13 asked again: costs against stiffness, a row for each problem and a column for each error."""
    rows = found_in(data.values())
    figure, panels = _grid(title, rows, len(ERRORS), sharex=True)
    for line, found in zip(panels, rows, strict=True):
        for panel, bound in zip(line, ERRORS, strict=True):
            _costs_panel(panel, found, measure, bound)
            panel.set_title(f"{PROBLEMS[found.problem].name}, {measure} to {_BOUND_LABELS[bound]}")
        line[0].set_ylabel("force evaluations [1]" if found.seconds is None else "wall time [s]")
    for panel in panels[-1]:
        panel.set_xlabel(style.STIFFNESS)
    law = style.line("the paper's law: ∝ √S", color=style.INK, linestyle=":", linewidth=1.0)
    more = style.mark("more than this, tried in vain", color=style.QUIET, **_MORE)
    _legend(figure, rows, [law, _hollow("ladder continued", markersize=4), more])
    return figure


# In this order the catalogue names them.
position, restitution, energy = (partial(_errors, measure=measure) for measure in _ERROR_LABELS)
cost_position, cost_restitution, cost_energy = (partial(_costs, measure=measure) for measure in _ERROR_LABELS)


def _grid(title: str, rows: list[Found], columns: int, sharex: Any) -> tuple[Figure, Any]:
    figure = style.new_figure(title, width=12.0, height=3.1 * len(rows) + 1.4)
    panels = figure.subplots(len(rows), columns, sharex=sharex, sharey="row", squeeze=False)
    for panel in panels.flat:
        panel.set(xscale="log", yscale="log")
    return figure, panels


def _legend(figure: Figure, rows: list[Found], handles: Iterable[Any], **words: Any) -> None:
    names = list(dict.fromkeys(name for found in rows for name in found.methods))
    handles = [*method_style.handles(names), *handles]
    figure.legend(handles=handles, loc="outside lower center", ncols=6, **words)


def _hollow(label: str, **look: Any) -> Any:
    return style.mark(f"hollow: {label}", "o", markerfacecolor="none", color=style.QUIET, **look)


def _draw_method(panel: Any, method: str, x: Array, y: Array, full: npt.NDArray[np.bool_]) -> None:
    """Draw a method's line, its marks full or hollow."""
    look = method_style.look(method)
    panel.plot(x, y, markevery=0, label=method, **look | {"marker": ""})
    panel.plot(x[full], y[full], **look | {"linestyle": "none"})
    panel.plot(x[~full], y[~full], **look | {"linestyle": "none", "markerfacecolor": "none"})


def _errors_panel(panel: Any, found: Found, stiffness: int, measure: str) -> None:
    data = found.data.isel(stiffness=stiffness)
    costs = found.data.evaluations.values if found.seconds is None else found.seconds
    low, high = data.floor.values[:, meanings_of(data.measure).index(measure)].tolist()
    errors = data[f"{measure}_error"].values
    # Errors of nothing are drawn at a tenth of the floor, or of the least error found.
    lowest = float(np.min(errors[errors > 0], initial=low)) / 10
    errors = np.clip(np.where(np.isnan(errors), np.inf, errors), lowest, _WORST)
    for k, method in enumerate(found.methods):
        drawn = (data.evaluations.values[k] > 0) & np.isfinite(costs[stiffness, k])
        full = np.ones_like(drawn) if found.itself is None else found.itself[stiffness, k]
        _draw_method(panel, method, costs[stiffness, k][drawn], errors[k][drawn], full[drawn])
    panel.axhspan(low, high, color=style.QUIET, alpha=0.25, linewidth=0)
    panel.axhline(low, color=style.QUIET, linewidth=0.8)
    panel.set_ylim(lowest / 2, 2 * _WORST)
    panel.set_title(f"{PROBLEMS[found.problem].name}, {ground_words(stiffness=float(data.stiffness))}")
    panel.set_xlabel("force evaluations [1]" if found.seconds is None else "median wall time [s]")


def _costs_panel(panel: Any, found: Found, measure: str, bound: float) -> None:
    stiffness = found.data.stiffness.values
    for method in found.methods:
        costs = [found.cost(method, i, measure, bound, timed=found.seconds is not None) for i in range(len(stiffness))]
        values, tried = np.array([cost.value for cost in costs]), np.array([cost.tried for cost in costs])
        _draw_method(panel, method, stiffness, values, np.array([cost.reached for cost in costs]))
        beyond, known = np.isnan(values), np.flatnonzero(np.isfinite(values))
        panel.plot(stiffness[beyond], tried[beyond], **method_style.look(method) | _MORE | {"linestyle": "none"})
        if method == _LAW_OF and known.size:
            law = values[known[0]] * np.sqrt(stiffness / stiffness[known[0]])
            panel.plot(stiffness, law, color=style.INK, linestyle=":", linewidth=1.0, zorder=1)
