"""A dense grid and adaptive ones: the answer of each with its confidence, and where its runs went."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.report.number_format import ground_words
from stiffdice.sweep.refinement_check import WIDTH, Column, Scan, band, binned, bins, common, effort, scans

_Scans = Mapping[str, Mapping[Column, Scan]]  # by sweep, the dense one first
_EDGES = {"last_fail": "last fail", "first_pass": "first pass"}
# Of the dense sweep and of those compared with it, in turn: colour, mark, and where it is put beside its stiffness.
_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": style.INK, "marker": "_", "markersize": 8, "beside": 1.0},
    {"color": style.QUIET, "marker": "x", "markersize": 4, "beside": 0.87},
    {"color": style.ORANGE, "marker": "o", "markersize": 4.5, "beside": 1.15},
    {"color": style.GREEN, "marker": "s", "markersize": 4, "beside": 1.32},
    {"color": style.BLUE, "marker": "v", "markersize": 4, "beside": 0.76},
)
# The factor in stiffness to either side that the band of an edge reaches.
_BOX = 1.15 * 1.1
_DENSITY_BINS = 24


def draw(sweeps: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return edges over stiffness, pass fractions at one stiffness and cells over ωh; a column for each contact law.

    sweeps: frontiers, the dense one first, at most five. Raises InputError if they are more or cannot be compared.
    """
    columns = common(sweeps)
    if len(sweeps) > len(_LOOKS):
        raise InputError(f"refinement-check: draws {len(_LOOKS)} sweeps at most, not {len(sweeps)}")
    first, *_ = sweeps.values()
    found = {name: scans(data) for name, data in sweeps.items()}
    broken = [column for column in columns if any((parts[column].shares < 1).any() for parts in found.values())]
    laws = list(dict.fromkeys(column.contact for column in columns))
    figure = style.new_figure(title, style.PAGE if len(laws) > 1 else style.COLUMN, 8.6)
    panels = figure.subplots(4, len(laws), sharey="row", squeeze=False, height_ratios=(1.15, 1.15, 1, 0.7))
    limits = first.limit.values * linear_theory.STABILITY_LIMIT
    products = dict(zip(first.stiffness.values.tolist(), limits, strict=True))
    for law, (*edges, shares, density) in zip(laws, panels.T, strict=True):
        here = [column for column in broken if column.contact == law]
        edges[0].set_title(style.law_of(first.sel(contact=meanings_of(first.contact).index(law))), pad=14)
        for panel, edge in zip(edges, _EDGES, strict=True):
            _edges(panel, here, found, products, edge)
        _shares(shares, here, found, products)
        _density(density, sweeps, law, shares.get_xlim())
    labels = [f"{edge}: {style.OMEGA_H}" for edge in _EDGES.values()]
    labels += ["share of members that pass [1]", "cells at a stiffness\nper e-fold of steps [1]"]
    for panel, label in zip(panels[:, 0], labels, strict=True):
        panel.set_ylabel(label)
    criteria = dict.fromkeys(column.criterion for column in broken)
    style.add_legend(figure, _legend(sweeps, criteria))
    return figure


def _edges(panel: Any, columns: list[Column], found: _Scans, products: Mapping[float, float], edge: str) -> None:
    """Draw an edge of every criterion over stiffness: the dense scan's band, and a mark for each sweep."""
    panel.set(xscale="log", yscale="log", xlabel=style.STIFFNESS)
    dense = next(iter(found.values()))
    for criterion in dict.fromkeys(column.criterion for column in columns):
        along = [column for column in columns if column.criterion == criterion]
        stiffness = np.array([column.stiffness for column in along])
        product = np.array([products[column.stiffness] for column in along])
        color = style.CRITERION_LOOKS[criterion]["color"]
        for column in along:
            # A box that all marks of a stiffness stand in front of.
            box = {"color": color, "alpha": 0.18, "linewidth": 0, "zorder": 1.5}
            ends = [column.stiffness / _BOX, column.stiffness * _BOX]
            low, high, _ = band(dense[column], edge)
            panel.fill_between(ends, products[column.stiffness] / high, products[column.stiffness] / low, **box)
        for look, parts in zip(_LOOKS, found.values(), strict=False):
            steps = np.array([parts[column].edges[edge] for column in along])
            mark = _open(look, color=color, markeredgewidth=1.1, linestyle="none", zorder=3)
            panel.plot(stiffness * look["beside"], product / steps, **mark)
    panel.axhline(linear_theory.STABILITY_LIMIT, **style.THEORY)
    style.plain_log_ticks(panel.yaxis, (1.0, 1.2, 1.5, 2.0, 3.0, 5.0, 7.0))


def _open(look: Mapping[str, Any], **other: Any) -> dict[str, Any]:
    """Return an open mark of a sweep's look."""
    return {name: look[name] for name in ("color", "marker", "markersize")} | {"markerfacecolor": "none"} | other


def _shares(panel: Any, columns: list[Column], found: _Scans, products: Mapping[float, float]) -> None:
    """Draw pass fractions of the least clear scan on the stiffest ground: means in bins, with 95 % bands."""
    panel.set(xscale="log", ylim=(-0.04, 1.08), xlabel=style.OMEGA_H)
    dense = next(iter(found.values()))
    column = max(columns, key=lambda column: (column.stiffness, np.count_nonzero(dense[column].shares % 1)))
    product, stiffest = products[column.stiffness], column.stiffness
    ends = bins(*(parts[column] for parts in found.values()))
    panel.plot(product / dense[column].steps, dense[column].shares, color=style.FAINT, linewidth=0.7, zorder=1.2)
    centres = product / np.exp((ends[1:] + ends[:-1]) / 2)
    for k, (look, parts) in enumerate(zip(_LOOKS, found.values(), strict=False)):
        mean, error = binned(parts[column], ends)
        low, high = (mean - WIDTH * error).clip(0), (mean + WIDTH * error).clip(max=1)
        if k == 0:
            panel.stairs(high, product / np.exp(ends), baseline=low, fill=True, color=look["color"], alpha=0.25)
            panel.stairs(mean, product / np.exp(ends), baseline=None, color=look["color"], linewidth=0.9)
        else:
            aside = centres * (1 + 0.012 * (2 * k - len(found)))
            bars = np.stack([mean - low, high - mean]).clip(0)
            panel.errorbar(aside, mean, bars, linestyle="none", elinewidth=0.9, zorder=3, **_open(look, markersize=3))
    panel.set_title(f"{column.criterion}, {ground_words(stiffness=stiffest)}")
    panel.set_xlim(product / np.exp(ends[-1]), product / np.exp(ends[0]))
    style.plain_log_ticks(panel.xaxis)


def _density(panel: Any, sweeps: Mapping[str, xr.Dataset], law: str, span: tuple[float, float]) -> None:
    """Draw how many cells of each sweep lie at an ωh, on average over stiffness."""
    panel.set(xscale="log", xlim=span, xlabel=style.OMEGA_H)
    ends = np.geomspace(*span, _DENSITY_BINS + 1)
    for k, (look, found) in enumerate(zip(_LOOKS, sweeps.values(), strict=False)):
        here = found.cell_contact.values == meanings_of(found.contact).index(law)
        counts = np.histogram(found.cell_omega_h.values[here], ends)[0] / found.sizes["stiffness"]
        counts /= np.log(span[1] / span[0]) / _DENSITY_BINS
        if k > 1:
            panel.stairs(counts, ends, fill=True, color=look["color"], alpha=0.25)
        panel.stairs(counts, ends, baseline=None, color=look["color"], linewidth=1.2 if k != 1 else 0.7)
    panel.set_ylim(bottom=0)
    style.plain_log_ticks(panel.xaxis)


def _legend(sweeps: Mapping[str, xr.Dataset], criteria: Iterable[str]) -> list[Any]:
    """Return what marks and colours mean, and how many runs and steps each sweep asked for."""
    handles: list[Any] = []
    first, *_ = sweeps.values()
    whole = effort(first)
    for k, (look, (name, data)) in enumerate(zip(_LOOKS, sweeps.items(), strict=False)):
        runs, steps = effort(data)
        part = f" ({runs / whole[0]:.0%}), {steps / whole[1]:.0%} of the steps" if k else ""
        handles.append(style.mark(f"{name}: {runs:,} runs{part}", **_open(look, markersize=6)))
    tolerances = dict(zip(meanings_of(first.criterion), first.tolerance.values.tolist(), strict=True))
    for criterion in criteria:
        words = f"{criterion}: {style.criterion_words(criterion, tolerances[criterion])}"
        handles.append(style.area(words, style.CRITERION_LOOKS[criterion]["color"], alpha=0.5))
    return [
        *handles,
        style.area("95 %: of dense grids with other jitter; of means", style.QUIET, alpha=0.3),
        style.line("share in the dense grid's cells, one by one", color=style.FAINT, linewidth=0.9),
        style.line("theory: ωh = 2", **style.THEORY),
    ]
