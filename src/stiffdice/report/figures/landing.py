"""Figures of landings: how often each face is up, and what coarse steps do to that and to paths."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style

# What the issue of coarse steps aims at: a distance of distributions, and a part of the way thrown.
_DISTANCE, _PATH = 0.003, 0.01


def faces(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the probability of each face with its 95 % interval, of every die."""
    figure = style.new_figure(title, height=2.6)
    panel = figure.subplots()
    panel.axhline(1 / 6, label="fair: 1/6", **style.THEORY)
    for k, (name, dataset) in enumerate(experiments.items()):
        look = style.SERIES[k % len(style.SERIES)]
        place = dataset.face.values + 0.12 * (k - (len(experiments) - 1) / 2)
        share = dataset.probability.values
        bars = share - dataset.probability_low.values, dataset.probability_high.values - share
        label = f"{name}, {int(dataset['count'].sum()):,} throws".replace(",", " ", 0)
        panel.errorbar(place, share, bars, **look, markersize=3, linestyle="none", label=label)
    panel.set(xlabel="face up [pips]", ylabel="probability [1]", xticks=range(1, 7), ylim=(0, None))
    style.add_legend(figure, panel.get_legend_handles_labels()[0])
    return figure


def coarse_steps(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return total variation, changed faces and error of paths against force evaluations, a column for each scene."""
    figure = style.new_figure(title, style.PAGE if len(experiments) > 1 else style.COLUMN, 6.0)
    panels = figure.subplots(3, len(experiments), sharey="row", sharex="col", squeeze=False)
    for column, (name, dataset) in enumerate(experiments.items()):
        _distributions(panels[0, column], dataset)
        panels[0, column].set_title(f"{name}\n{int(dataset.attrs['throws']):,} throws each")
        _paths(panels[1, column], dataset, "face_changed")
        _paths(panels[2, column], dataset, "path_error")
        panels[2, column].set_yscale("log")
        panels[2, column].axhline(_PATH, color=style.QUIET, linewidth=0.8, linestyle=":")
        panels[2, column].set_xlabel("force evaluations of a throw [1]")
    for row, text in enumerate(("total variation of faces [1]", "share of faces changed [1]", "error of the path [1]")):
        panels[row, 0].set_ylabel(text)
    schemes = dict.fromkeys(name for found in experiments.values() for name in meanings_of(found.scheme))
    handles = [
        style.mark("faces: symplectic euler", color=style.BLUE, marker="o"),
        style.area("two samples of one distribution: 95 % are below", style.FAINT),
        *(style.line(f"paths: {name.replace('_', ' ')}", markersize=3, **style.METHOD_LOOKS[name]) for name in schemes),
        style.line(f"aims: {_DISTANCE:g} of faces, {_PATH:.0%} of a path", color=style.QUIET, linestyle=":"),
    ]
    style.add_legend(figure, handles)
    return figure


def _distributions(panel: Any, dataset: xr.Dataset) -> None:
    work, distance = dataset.evaluations.values, dataset.total_variation.values
    order = np.argsort(work)
    panel.fill_between(work[order], 1e-4, dataset.sampling_95.values[order], color=style.FAINT, linewidth=0)
    panel.plot(work[order], distance[order], color=style.BLUE, marker="o", markersize=3)
    values = ", ".join(f"{value:g}" for value in dataset.omega_h.values[order])
    place = {"transform": panel.transAxes, "ha": "right", "va": "top", "fontsize": style.SMALL}
    panel.text(0.98, 0.95, f"ωh from the left:\n{values}", **place)
    panel.axhline(_DISTANCE, color=style.QUIET, linewidth=0.8, linestyle=":")
    panel.set(xscale="log", yscale="log", ylim=(2e-4, 1))
    panel.xaxis.set_minor_formatter(NullFormatter())


def _paths(panel: Any, dataset: xr.Dataset, name: str) -> None:
    for k, scheme in enumerate(meanings_of(dataset.scheme)):
        work, values = dataset.path_evaluations.values[k], dataset[name].values[k]
        panel.plot(work, values, markersize=3, **style.METHOD_LOOKS[scheme])
    if name == "face_changed":
        panel.set_ylim(0, 1)
