"""What sweeps found: Figure 13, the map of stability, and pass fractions at one stiffness."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import Array
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.report.number_format import ground_words, scene_of
from stiffdice.sweep.stability_limits import EDGES, FIT, band

_MODELS = {
    "vertical": "a cube that falls straight",
    "sliding": "a cube that slides",
    "tumbling": "a cube that tumbles",
    "flying": "a cube in flight",
}

# In a map, magic steps beyond these n lie too close for a number each, and for a tick; beyond the third, for a line.
_NUMBERED, _TICKED, _LINED = 6, 40, 12

_NOT_ASKED: dict[str, Any] = {"ha": "center", "color": style.QUIET}

# The paper's step counts at high stiffness, by the figures that show them; and that stiffness [kg/s²] and duration [s].
PAPER_STEPS = {"figures 9 and 10": 10_000, "figures 11 and 12": 20_000}
PAPER_SCENE = 1e6, 10.0
_PAPER_LOOK: dict[str, Any] = {"marker": "^", "color": style.INK, "markersize": 4.5}
_MAGIC_LOOK: dict[str, Any] = {"color": style.INK, "linewidth": 0.8, "linestyle": ":"}

# Labelled on top of pass fractions; and widths of their lines, by criterion: the first is the widest, so that all show.
_OMEGA_H = (4.0, 3.0, 2.0, 1.5, 1.2, 1.0, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1)
_WIDTHS = (3.0, 2.4, 0.8, 1.2, 0.7)


def steps_needed(sweeps: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return steps against stiffness above, and the same edges as ωh below, a column for each sweep and contact law."""
    columns = style.by_law(sweeps.values())
    figure = style.new_figure(title, style.PAGE if len(columns) > 1 else style.COLUMN, 5.8)
    panels = figure.subplots(2, len(columns), sharex=True, sharey="row", squeeze=False)
    for (upper, lower), frontier in zip(panels.T, columns, strict=True):
        model = "" if len(sweeps) == 1 else _MODELS.get(frontier.attrs["model"], frontier.attrs["model"]) + ", "
        upper.set_title(model + style.law_of(frontier))
        _steps(upper, frontier)
        _omega_h(lower, frontier)
    notes = max(len(panel.texts) for panel in panels[0])
    top = panels[0, 0].get_ylim()[1] * 10 ** (0.12 * notes)  # room for them above the lines
    panels[0, 0].set(ylim=(None, top), ylabel=f"time steps in {scene_of(columns[0])['duration']:g} s [1]")
    panels[1, 0].set_ylabel(style.OMEGA_H)
    handles: list[Any] = []
    found = {name: part for frontier in columns for name, part in style.broken_criteria(frontier).items()}
    for criterion, part in found.items():
        look = style.CRITERION_LOOKS[criterion]
        words = style.criterion_words(criterion, float(part.tolerance), columns[0].attrs.get("hop_height"))
        open_mark = {"color": look["color"], "markersize": 4.5, "markerfacecolor": "none"}
        handles.append(style.mark(f"first pass: {words}", look["first"], **open_mark))
        handles.append(style.mark(f"last fail: {words}", look["last"], color=look["color"], markersize=3))
    handles.append(style.line("theory: ωh = 2", **style.THEORY))
    handles.append(style.area("scanned cell, darker: more fail", style.QUIET))
    style.add_legend(figure, handles)
    return figure


def _steps(panel: Any, frontier: xr.Dataset) -> None:
    stiffness, broken = frontier.stiffness.values, style.broken_criteria(frontier)
    panel.set(xscale="log", yscale="log")
    panel.plot(stiffness, frontier.limit, zorder=4, **style.THEORY)
    notes = []
    for criterion, found in broken.items():
        look = style.CRITERION_LOOKS[criterion]
        first, last = found.first_pass.values, found.last_fail.values
        panel.fill_between(stiffness, first, last, color=look["color"], alpha=0.10, linewidth=0)
        _marks(panel, stiffness, first, last, look)
        fit = {name: float(found[name].isel(edge=list(EDGES).index("last_fail"))) for name in FIT}
        if np.isfinite(fit["exponent"]):
            low, high = band(fit, stiffness)
            panel.fill_between(stiffness, low, high, color=look["color"], alpha=0.25, linewidth=0)
            panel.plot(stiffness, fit["factor"] * stiffness ** fit["exponent"], color=look["color"], linewidth=0.8)
            digits = 3 if fit["exponent_error"] >= 5e-4 else 4
            power = f"{fit['exponent']:.{digits}f} ± {fit['exponent_error']:.{digits}f}"
            notes.append((f"{criterion}: last fail ∝ S to the {power}", look["color"]))
    whole = sorted(set(meanings_of(frontier.criterion)) - set(broken))
    notes += [(f"{name}: every member passes in every cell", style.QUIET) for name in whole]
    for k, (note, color) in enumerate(notes):
        panel.text(0.03, 0.97 - 0.06 * k, note, color=color, transform=panel.transAxes, va="top", fontsize=style.SMALL)


def _marks(panel: Any, stiffness: Any, first: Any, last: Any, look: Mapping[str, str]) -> None:
    """Draw last fail full and first pass open, the open mark larger, so that neither hides the other."""
    panel.plot(stiffness, last, look["last"], color=look["color"], markersize=3, zorder=3)
    panel.plot(stiffness, first, look["first"], color=look["color"], markersize=4.5, markerfacecolor="none", zorder=4)


def _omega_h(panel: Any, frontier: xr.Dataset) -> None:
    """Draw the edges as ωh, over all scanned cells: a dot each, dark where members fail."""
    panel.set(xscale="log", yscale="log", xlabel=style.STIFFNESS)
    scan = frontier.isel(cell=frontier.cell_contact.values == int(frontier.contact))
    failing = 1 - scan.pass_fraction.values.min(axis=0)
    # As a drawing it would be 170 bytes a cell.
    look: dict[str, Any] = {
        "s": 2.5,
        "cmap": style.CELLS,
        "vmin": -0.15,
        "vmax": 1.3,
        "linewidths": 0,
        "rasterized": True,
    }
    panel.scatter(scan.cell_stiffness, scan.cell_omega_h, c=failing, **look)
    panel.axhline(linear_theory.STABILITY_LIMIT, **style.THEORY)
    scale = frontier.limit.values * linear_theory.STABILITY_LIMIT
    for criterion, found in style.broken_criteria(frontier).items():
        first, last = (scale / found[edge].values for edge in ("first_pass", "last_fail"))
        _marks(panel, frontier.stiffness, first, last, style.CRITERION_LOOKS[criterion])
    style.plain_log_ticks(panel.yaxis)


def stability_map(sweeps: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the share of members that pass by stiffness and ωh, a row for each criterion, a column for sweep and law.

    Cells are sorted. Each cell reaches half-way to its neighbours, in the logarithms of stiffness and ωh. A criterion
    that all members pass is told, not drawn; one that is asked at two tolerances has two rows; a panel stays empty
    where a sweep was not asked.
    """
    columns = [found.isel(cell=found.cell_contact == found.contact) for found in style.by_law(sweeps.values())]
    # Of each column and criterion with its tolerance the share of each cell's members that pass, shape (cell,).
    shares = [
        dict(zip(zip(meanings_of(found.criterion), found.tolerance.values.tolist(), strict=True), values, strict=True))
        for found in columns
        for values in [found.pass_fraction.values]
    ]
    order = list(style.CRITERION_LOOKS)
    asked = sorted({pair for found in shares for pair in found}, key=lambda pair: (order.index(pair[0]), pair[1]))
    passed = [pair for pair in asked if not any((found.get(pair, np.ones(1)) < 1).any() for found in shares)]
    rows = [pair for pair in asked if pair not in passed] or asked
    figure = style.new_figure(title, style.PAGE if len(columns) > 1 else style.COLUMN, 1.2 + 1.9 * len(rows))
    panels = figure.subplots(len(rows), len(columns), sharex=True, sharey=True, squeeze=False)
    corners = [_rectangles(found) for found in columns]
    look: Any = {"norm": Normalize(0, 1), "cmap": style.SHARES, "antialiased": False, "rasterized": True, "zorder": 1}
    for pair, row in zip(rows, panels, strict=True):
        for panel, found, cells, given in zip(row, columns, corners, shares, strict=True):
            panel.set(xscale="log", yscale="log")
            drawn = PolyCollection(list(cells), array=given.get(pair, np.full(len(cells), np.nan)), **look)
            panel.add_collection(drawn)
            panel.grid(visible=False)
            if pair not in given:
                panel.text(0.5, 0.5, "not asked of this sweep", **_NOT_ASKED, transform=panel.transAxes)
            _magic_ticks(panel, found, numbered=panel is row[-1])
        row[0].set_ylabel(f"{style.criterion_words(*pair)}\n{style.OMEGA_H}")
    sides = np.concatenate([cells[..., 0] for cells in corners])
    omega_h = np.concatenate([found.cell_omega_h.values for found in columns])
    panels[0, 0].set(xlim=(sides.min(), sides.max()), ylim=(omega_h.min(), omega_h.max()))
    for panel, found in zip(panels[0], columns, strict=True):
        ground = ground_words(**{name: scene_of(found)["ground"][name] for name in ("damping", "friction")})
        panel.set_title(f"{found.attrs['model']}, {style.law_of(found)}\n{ground}", fontsize=style.SMALL)
    for panel in panels[-1]:
        panel.set_xlabel(style.STIFFNESS)
    bar = figure.colorbar(drawn, ax=panels, location="bottom", aspect=50, shrink=0.6, pad=0.02)
    bar.set_label("share of members that pass [1]")
    note = "dashed: ωh = 2; right: magic steps ωh = 2 sin(π/2n), by n; what is narrower than a cell may be missed"
    note += f"; not drawn, as all members pass: {', '.join(name for name, _ in passed)}" if passed else ""
    style.add_note(figure, note)
    return figure


def _rectangles(found: xr.Dataset) -> Array:
    """Return the corners of each cell, in stiffness and ωh, shape (cell, 4, 2)."""
    stiffness, omega_h = found.cell_stiffness.values, found.cell_omega_h.values
    corners, columns = np.empty((len(stiffness), 4, 2)), np.unique(stiffness)
    sides = style.borders(columns, logarithmic=True)
    for column, left, right in zip(columns, sides[:-1], sides[1:], strict=True):
        cells = stiffness == column
        ends = style.borders(omega_h[cells], logarithmic=True)
        corners[cells, :, 0] = left, right, right, left
        corners[cells, :, 1] = np.stack([ends[:-1], ends[:-1], ends[1:], ends[1:]], axis=1)
    return corners


def _magic_ticks(panel: Any, found: xr.Dataset, *, numbered: bool) -> None:
    """Draw the limit, and ticks on the right at the magic steps, with their n if `numbered`."""
    panel.axhline(linear_theory.STABILITY_LIMIT, color=style.PAPER, linestyle="--", linewidth=1.0)
    style.plain_log_ticks(panel.yaxis)
    magic = linear_theory.magic_steps(found.cell_omega_h.values.min(), found.cell_omega_h.values.max(), _TICKED)
    right = panel.secondary_yaxis("right")
    right.set_yticks(list(magic.values()), [str(n) if numbered and n <= _NUMBERED else "" for n in magic])
    right.minorticks_off()
    right.tick_params(labelsize=style.SMALL)
    if numbered:
        right.set_ylabel("magic steps, by n [1]", fontsize=style.SMALL)


def pass_fraction(sweeps: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the share of members that pass against the number of steps, a panel for each contact law and stiffness.

    Cells are sorted. A criterion that all members of a panel pass is told, not drawn.
    """
    scans = [
        found.isel(cell=(found.cell_contact == law) & (found.cell_stiffness == stiffness))
        for found in sweeps.values()
        for law, stiffness in np.unique([found.cell_contact, found.cell_stiffness], axis=1).T
    ]
    figure = style.new_figure(title, style.PAGE, 1.2 + 1.8 * len(scans))
    panels = figure.subplots(len(scans), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    looks = {
        name: {"color": look["color"], "linestyle": look["line"], "linewidth": _WIDTHS[min(k, len(_WIDTHS) - 1)]}
        for k, (name, look) in enumerate(style.CRITERION_LOOKS.items())
    }
    drawn: dict[tuple[str, float], None] = {}
    for panel, scan in zip(panels, scans, strict=True):
        steps, broken = scan.cell_steps.values, style.broken_criteria(scan)
        for name, found in broken.items():
            shade = {"color": looks[name]["color"], "alpha": 0.12, "linewidth": 0, "zorder": 1.5}
            panel.fill_between(steps, found.pass_fraction_low, found.pass_fraction_high, **shade)
            panel.plot(steps, found.pass_fraction, label=name, zorder=2.5, **looks[name])
            drawn[name, float(found.tolerance)] = None
        _known_steps(panel, scan)
        ground = scene_of(scan)["ground"] | {"stiffness": float(scan.cell_stiffness[0])}
        numbers = ground_words(**{name: ground[name] for name in ("stiffness", "damping", "friction")})
        passed = ", ".join(name for name in meanings_of(scan.criterion) if name not in broken)
        named = f"{style.law_of(scan, 'cell_contact')}, {numbers}{f'; all pass: {passed}' if passed else ''}"
        panel.set(title=named, ylabel="share of members\nthat pass [1]")
    steps = np.concatenate([scan.cell_steps.values for scan in scans])
    room = 0.02 * (steps.max() - steps.min())
    panels[-1].set(xlim=(steps.min() - room, steps.max() + 2 * room), ylim=(-0.08, 1.18), yticks=np.linspace(0, 1, 6))
    panels[-1].set_xlabel(f"time steps in {scene_of(scans[0])['duration']:g} s [1]")
    panels[-1].xaxis.set_major_formatter("{x:,.0f}")
    handles: list[Any] = [style.line(style.criterion_words(*pair), **looks[pair[0]]) for pair in drawn]
    handles.append(style.area("95 % confidence (Wilson)", style.QUIET, alpha=0.3))
    handles.append(style.line("magic step, ωh = 2 sin(π/2n)", **_MAGIC_LOOK))
    if any(_of_the_paper(scan) for scan in scans):
        paper = ", ".join(f"{steps:,} ({where})" for where, steps in PAPER_STEPS.items())
        handles.append(style.mark(f"the paper's steps: {paper}", **_PAPER_LOOK))
    style.add_legend(figure, handles)
    return figure


def _known_steps(panel: Any, scan: xr.Dataset) -> None:
    """Mark what theory says of some step counts, and those that the paper took."""
    steps = scan.cell_steps.values
    product = float(scan.cell_omega_h[0] * scan.cell_steps[0])  # ωh times steps is the same for all
    magic = linear_theory.magic_steps(product / steps[-1], product / steps[0], _LINED)
    marks = [(product / omega_h, f"n = {n}", _MAGIC_LOOK) for n, omega_h in magic.items()]
    limit = product / linear_theory.STABILITY_LIMIT
    if steps[0] <= limit <= steps[-1]:
        marks.append((limit, "ωh = 2", style.THEORY))
    for place, name, look in marks:
        panel.axvline(place, zorder=2, **look)
        style.write_beside(panel, name, (place, 1.17), (3, 0), va="top", fontsize=style.SMALL, color=style.INK)
    taken = [count for count in PAPER_STEPS.values() if _of_the_paper(scan) and steps[0] <= count <= steps[-1]]
    panel.plot(taken, [-0.05] * len(taken), linestyle="none", **_PAPER_LOOK)
    shown = [value for value in _OMEGA_H if steps[0] <= product / value <= steps[-1]]
    top = style.top_axis(panel, [product / value for value in shown], [f"{value:g}" for value in shown])
    top.set_xlabel(style.OMEGA_H, fontsize=style.SMALL)


def _of_the_paper(scan: xr.Dataset) -> bool:
    return (float(scan.cell_stiffness[0]), scene_of(scan)["duration"]) == PAPER_SCENE
