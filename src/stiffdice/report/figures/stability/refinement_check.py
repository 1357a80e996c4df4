"""A dense grid and elastic ones: the answer of each with its confidence, and where its runs went."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator

from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report import number_format
from stiffdice.report.figures import style
from stiffdice.sweep.refinement_check import WIDTH, Band, Column, Scan, band, binned, bins, common, effort, scans

_EDGES = {"last_fail": "last fail", "first_pass": "first pass"}
# Of the dense sweep and of those compared with it, in turn: colour, mark, and where it is put beside its stiffness.
_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": style.INK, "marker": "_", "markersize": 8, "beside": 1.0},
    {"color": style.QUIET, "marker": "x", "markersize": 4, "beside": 0.87},
    {"color": style.ORANGE, "marker": "o", "markersize": 4.5, "beside": 1.15},
    {"color": style.GREEN, "marker": "s", "markersize": 4, "beside": 1.32},
    {"color": style.BLUE, "marker": "v", "markersize": 4, "beside": 0.76},
)
_DENSITY_BINS = 24


def draw(sweeps: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return edges over stiffness, pass fractions at one stiffness and cells over ωh; a column for each contact law.

    sweeps: frontiers, the dense one first, at most five. Raises InputError if they are more or cannot be compared.
    """
    columns = common(sweeps)
    if len(sweeps) > len(_LOOKS):
        raise InputError(f"refinement-check: draws {len(_LOOKS)} sweeps at most, not {len(sweeps)}")
    found = {name: scans(data) for name, data in sweeps.items()}
    laws = list(dict.fromkeys(column.contact for column in columns))
    figure = style.new_figure(title, width=5.0 * len(laws) + 0.4, height=11.4)
    panels = figure.subplots(4, len(laws), sharey="row", squeeze=False, height_ratios=(1.15, 1.15, 1, 0.7))
    products = _products(next(iter(sweeps.values())))
    for law, (*edges, shares, density) in zip(laws, panels.T, strict=True):
        here = [column for column in columns if column.contact == law and _is_broken(found, column)]
        edges[0].set_title(style.LAW_NAMES[law] + style.maker_of(next(iter(sweeps.values()))), pad=14)
        for panel, edge in zip(edges, _EDGES, strict=True):
            _edges(panel, here, found, products, edge)
        _shares(shares, here, found, products)
        _density(density, sweeps, law, shares.get_xlim())
    for panel, edge in zip(panels[:2, 0], _EDGES.values(), strict=True):
        panel.set_ylabel(f"{edge}: ωh of a flat landing [1]")
    panels[2, 0].set_ylabel("share of members that pass [1]")
    panels[3, 0].set_ylabel("cells at a stiffness\nper e-fold of steps [1]")
    figure.legend(handles=_legend(sweeps, columns, found), loc="outside lower center", ncols=2)
    return figure


def _products(found: xr.Dataset) -> dict[float, float]:
    """Return ωh times steps by stiffness."""
    return dict(zip(found.stiffness.values.tolist(), found.limit.values * linear_theory.STABILITY_LIMIT, strict=True))


def _is_broken(found: Mapping[str, Mapping[Column, Scan]], column: Column) -> bool:
    return any((parts[column].shares < 1).any() for parts in found.values())


def _edges(
    panel: Any,
    columns: list[Column],
    found: Mapping[str, Mapping[Column, Scan]],
    products: Mapping[float, float],
    edge: str,
) -> None:
    """Draw an edge of every criterion over stiffness: the dense scan's band, and a mark for each sweep."""
    panel.set(xscale="log", yscale="log", xlabel="stiffness S [kg/s²]")
    dense = next(iter(found.values()))
    for criterion in dict.fromkeys(column.criterion for column in columns):
        along = [column for column in columns if column.criterion == criterion]
        stiffness = np.array([column.stiffness for column in along])
        product = np.array([products[column.stiffness] for column in along])
        color = style.CRITERION_LOOKS[criterion]["color"]
        limits = [band(dense[column], edge) for column in along]
        for place, scale, limit in zip(stiffness, product, limits, strict=True):
            _box(panel, place, scale, limit, color)
        for look, parts in zip(_LOOKS, found.values(), strict=False):
            steps = np.array([parts[column].edges[edge] for column in along])
            panel.plot(
                stiffness * look["beside"],
                product / steps,
                look["marker"],
                color=color,
                markersize=look["markersize"],
                markerfacecolor="none",
                markeredgewidth=1.1,
                zorder=3,
            )
    panel.axhline(linear_theory.STABILITY_LIMIT, color=style.INK, linestyle="--", linewidth=0.9)
    _plain_ticks(panel.yaxis, (1.0, 1.2, 1.5, 2.0, 3.0, 5.0, 7.0))


def _box(panel: Any, stiffness: float, product: float, limit: Band, color: str) -> None:
    """Draw the band of one edge as a box that all marks of a stiffness stand in front of."""
    width = max(look["beside"] for look in _LOOKS[:3]) * 1.1
    panel.fill_between(
        [stiffness / width, stiffness * width],
        product / limit.high,
        product / limit.low,
        color=color,
        alpha=0.18,
        linewidth=0,
        zorder=1.5,
    )


def _plain_ticks(axis: Any, subs: Sequence[float]) -> None:
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def _shares(
    panel: Any, columns: list[Column], found: Mapping[str, Mapping[Column, Scan]], products: Mapping[float, float]
) -> None:
    """Draw pass fractions of the least clear scan on the stiffest ground: means in bins, with 95 % bands."""
    panel.set(xscale="log", ylim=(-0.04, 1.08), xlabel="ωh of a flat landing [1]")
    dense = next(iter(found.values()))
    stiffest = max(column.stiffness for column in columns)
    column = max(
        (column for column in columns if column.stiffness == stiffest),
        key=lambda column: np.count_nonzero(dense[column].shares % 1),
    )
    product = products[stiffest]
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
            panel.errorbar(
                aside,
                mean,
                bars,
                fmt=look["marker"],
                color=look["color"],
                markersize=3,
                markerfacecolor="none",
                linewidth=0.9,
                zorder=3,
            )
    panel.set_title(f"{column.criterion}, S = {number_format.readable(stiffest)} kg/s²", fontsize=8.5)
    panel.set_xlim(product / np.exp(ends[-1]), product / np.exp(ends[0]))
    _plain_ticks(panel.xaxis, (1.0, 2.0, 5.0))


def _density(panel: Any, sweeps: Mapping[str, xr.Dataset], law: str, span: tuple[float, float]) -> None:
    """Draw how many cells of each sweep lie at an ωh, on average over stiffness."""
    panel.set(xscale="log", xlim=span, xlabel="ωh of a flat landing [1]")
    ends = np.geomspace(*span, _DENSITY_BINS + 1)
    width = np.log(span[1] / span[0]) / _DENSITY_BINS
    for k, (look, found) in enumerate(zip(_LOOKS, sweeps.values(), strict=False)):
        here = found.cell_contact.values == meanings_of(found.contact).index(law)
        counts = np.histogram(found.cell_omega_h.values[here], ends)[0] / found.sizes["stiffness"] / width
        if k > 1:
            panel.stairs(counts, ends, fill=True, color=look["color"], alpha=0.25)
        panel.stairs(counts, ends, baseline=None, color=look["color"], linewidth=1.2 if k != 1 else 0.7)
    panel.set_ylim(bottom=0)
    _plain_ticks(panel.xaxis, (1.0, 2.0, 5.0))


def _legend(
    sweeps: Mapping[str, xr.Dataset], columns: list[Column], found: Mapping[str, Mapping[Column, Scan]]
) -> list[Any]:
    """Return what marks and colours mean, and how many runs and steps each sweep asked for."""
    handles: list[Any] = []
    whole = effort(next(iter(sweeps.values())))
    for k, (look, (name, data)) in enumerate(zip(_LOOKS, sweeps.items(), strict=False)):
        runs, steps = effort(data)
        part = f" ({runs / whole[0]:.0%}), {steps / whole[1]:.0%} of the steps" if k else ""
        handles.append(
            Line2D(
                [],
                [],
                linestyle="none",
                marker=look["marker"],
                color=look["color"],
                markersize=6,
                markerfacecolor="none",
                label=f"{name}: {runs:,} runs{part}",
            )
        )
    first = next(iter(sweeps.values()))
    tolerances = dict(zip(meanings_of(first.criterion), first.tolerance.values.tolist(), strict=True))
    broken = dict.fromkeys(column.criterion for column in columns if _is_broken(found, column))
    for criterion in broken:
        words = style.criterion_words(criterion, tolerances[criterion])
        look = style.CRITERION_LOOKS[criterion]
        handles.append(Patch(color=look["color"], alpha=0.5, linewidth=0, label=f"{criterion}: {words}"))
    handles.append(
        Patch(color=style.QUIET, alpha=0.3, linewidth=0, label="95 %: of dense grids with other jitter; of means")
    )
    handles.append(
        Line2D([], [], color=style.FAINT, linewidth=0.9, label="share in the dense grid's cells, one by one")
    )
    handles.append(Line2D([], [], color=style.INK, linestyle="--", linewidth=0.9, label="theory: ωh = 2"))
    return handles
