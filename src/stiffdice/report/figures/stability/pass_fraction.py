"""Pass fractions: at one stiffness, numbers of steps that pass between numbers that fail."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffdice.dynamics import linear_theory
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.report.number_format import ground_words, scene_of

# The paper's step counts at high stiffness, by the figures that show them; and that stiffness [kg/s²] and duration [s].
PAPER_STEPS = {"figures 9 and 10": 10_000, "figures 11 and 12": 20_000}
PAPER_SCENE = 1e6, 10.0
_PAPER_LOOK: dict[str, Any] = {"marker": "^", "color": style.INK, "markersize": 6}

_OMEGA_H = (4.0, 3.0, 2.0, 1.5, 1.2, 1.0, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1)

_MAGIC_LOOK: dict[str, Any] = {"color": style.INK, "linewidth": 0.8, "linestyle": ":"}
# Magic steps beyond this n are not drawn: they lie too close.
_LAST = 12

_WIDTHS = (3.6, 2.8, 1.8, 1.2, 0.7)


def draw(sweeps: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the share of members that pass against the number of steps, a panel for each contact law and stiffness.

    Cells are sorted. A criterion that all members of a panel pass is told, not drawn.
    """
    scans = [scan for found in sweeps.values() for scan in _scans(found)]
    figure = style.new_figure(title, width=10.5, height=1.3 + 2.6 * len(scans))
    panels = figure.subplots(len(scans), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for panel, scan in zip(panels, scans, strict=True):
        _shares(panel, scan)
        _theory(panel, scan)
        panel.set(title=_named(scan), ylabel="share of members\nthat pass [1]")
    steps = np.concatenate([scan.cell_steps.values for scan in scans])
    room = 0.02 * (steps.max() - steps.min())
    panels[-1].set(xlim=(steps.min() - room, steps.max() + 2 * room), ylim=(-0.08, 1.18), yticks=np.linspace(0, 1, 6))
    panels[-1].set_xlabel(f"time steps in {scene_of(scans[0])['duration']:g} s [1]")
    panels[-1].xaxis.set_major_formatter("{x:,.0f}")
    figure.legend(handles=_legend(scans), loc="outside lower center", ncols=3)
    return figure


def _scans(found: xr.Dataset) -> Iterator[xr.Dataset]:
    """Give the cells of one contact law and stiffness after the other."""
    laws, stiffnesses = found.cell_contact.values, found.cell_stiffness.values
    for law, stiffness in sorted(set(zip(laws.tolist(), stiffnesses.tolist(), strict=True))):
        yield found.isel(cell=(laws == law) & (stiffnesses == stiffness))


def _shares(panel: Any, scan: xr.Dataset) -> None:
    steps = scan.cell_steps.values
    for name, found in style.broken_criteria(scan).items():
        look = _line(name)
        band = {"color": look["color"], "alpha": 0.12, "linewidth": 0, "zorder": 1.5}
        panel.fill_between(steps, found.pass_fraction_low, found.pass_fraction_high, **band)
        panel.plot(steps, found.pass_fraction, label=name, zorder=2.5, **look)


def _line(criterion: str) -> dict[str, Any]:
    """Return a criterion's look: the first has the widest line, the last the thinnest; all that coincide show."""
    widths = dict(zip(style.CRITERION_LOOKS, _WIDTHS, strict=False))
    return {"color": style.CRITERION_LOOKS[criterion]["color"], "linewidth": widths.get(criterion, _WIDTHS[-1])}


def _theory(panel: Any, scan: xr.Dataset) -> None:
    """Mark what theory says of some step counts, and those that the paper took."""
    steps = scan.cell_steps.values
    product = float(scan.cell_omega_h[0] * scan.cell_steps[0])  # ωh times steps is the same for all
    magic = linear_theory.magic_steps(product / steps[-1], product / steps[0], _LAST)
    marks = [(product / omega_h, f"n = {n}", _MAGIC_LOOK) for n, omega_h in magic.items()]
    limit = product / linear_theory.STABILITY_LIMIT
    if steps[0] <= limit <= steps[-1]:
        marks.append((limit, "ωh = 2", style.THEORY))
    for place, name, look in marks:
        panel.axvline(place, zorder=2, **look)
        style.write_beside(panel, name, (place, 1.17), (3, 0), va="top", fontsize=7.5, color=style.INK)
    taken = [count for count in PAPER_STEPS.values() if _of_the_paper(scan) and steps[0] <= count <= steps[-1]]
    panel.plot(taken, [-0.05] * len(taken), linestyle="none", **_PAPER_LOOK)
    shown = [value for value in _OMEGA_H if steps[0] <= product / value <= steps[-1]]
    top = style.top_axis(panel, [product / value for value in shown], [f"{value:g}" for value in shown])
    top.set_xlabel(style.OMEGA_H, fontsize=7.5)


def _of_the_paper(scan: xr.Dataset) -> bool:
    return (float(scan.cell_stiffness[0]), scene_of(scan)["duration"]) == PAPER_SCENE


def _named(scan: xr.Dataset) -> str:
    ground, broken = scene_of(scan)["ground"], style.broken_criteria(scan)
    passed = [name for name in meanings_of(scan.criterion) if name not in broken]
    stiffness = float(scan.cell_stiffness[0])
    numbers = ground_words(stiffness=stiffness, damping=ground["damping"], friction=ground["friction"])
    all_pass = f"; all pass: {', '.join(passed)}" if passed else ""
    return f"{style.law_of(scan, 'cell_contact')}, {numbers}{all_pass}"


def _legend(scans: Sequence[xr.Dataset]) -> list[Any]:
    broken = [style.broken_criteria(scan).items() for scan in scans]
    pairs = dict.fromkeys((name, float(found.tolerance)) for items in broken for name, found in items)
    handles: list[Any] = [style.line(style.criterion_words(*pair), **_line(pair[0])) for pair in pairs]
    handles.append(style.area("95 % confidence (Wilson)", style.QUIET, alpha=0.3))
    handles.append(style.line("magic step, ωh = 2 sin(π/2n)", **_MAGIC_LOOK))
    if any(_of_the_paper(scan) for scan in scans):
        paper = ", ".join(f"{steps:,} ({where})" for where, steps in PAPER_STEPS.items())
        handles.append(style.mark(f"the paper's steps: {paper}", **_PAPER_LOOK))
    return handles
