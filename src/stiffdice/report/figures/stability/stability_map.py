"""The map of stability: how many members pass a criterion, by stiffness and ωh."""

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

# Magic steps beyond these n lie too close for a number each, and for a tick.
_NUMBERED, _LAST = 6, 40


def draw(sweeps: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the share of members that pass, a row for each criterion, a column for each sweep and contact law.

    Cells are sorted. Each cell reaches half-way to its neighbours, in the
    logarithms of stiffness and ωh. A criterion that all members pass is told, not drawn; one that is asked at two
    tolerances has two rows; a panel stays empty where a sweep was not asked.
    """
    columns = [found.isel(cell=found.cell_contact == found.contact) for found in style.by_law(sweeps.values())]
    asked = sorted({pair for found in columns for pair in _asked(found)}, key=_rank)
    passed = [pair for pair in asked if not any((_shares(found, pair) < 1).any() for found in columns)]
    rows = [pair for pair in asked if pair not in passed] or asked
    figure = style.new_figure(title, width=1.8 + 3.0 * len(columns), height=1.4 + 2.5 * len(rows))
    panels = figure.subplots(len(rows), len(columns), sharex=True, sharey=True, squeeze=False)
    for pair, row in zip(rows, panels, strict=True):
        for panel, found in zip(row, columns, strict=True):
            drawn = _cells(panel, found, _shares(found, pair))
            _theory(panel, found, numbered=panel is row[-1])
        row[0].set_ylabel(f"{style.criterion_words(*pair)}\n{style.OMEGA_H}")
    sides = np.concatenate([_rectangles(found)[..., 0] for found in columns])
    omega_h = np.concatenate([found.cell_omega_h.values for found in columns])
    panels[0, 0].set(xlim=(sides.min(), sides.max()), ylim=(omega_h.min(), omega_h.max()))
    for panel, found in zip(panels[0], columns, strict=True):
        panel.set_title(_named(found), fontsize=8.5)
    for panel in panels[-1]:
        panel.set_xlabel(style.STIFFNESS)
    bar = figure.colorbar(drawn, ax=panels, location="bottom", aspect=50, shrink=0.6, pad=0.02)
    bar.set_label("share of members that pass [1]")
    note = "dashed: ωh = 2; right: magic steps ωh = 2 sin(π/2n), by n; what is narrower than a cell may be missed"
    note += f"; not drawn, as all members pass: {', '.join(name for name, _ in passed)}" if passed else ""
    style.add_note(figure, note)
    return figure


def _asked(found: xr.Dataset) -> list[tuple[str, float]]:
    """Return the criteria that a sweep was asked, with their tolerances."""
    return list(zip(meanings_of(found.criterion), found.tolerance.values.tolist(), strict=True))


def _rank(pair: tuple[str, float]) -> tuple[int, float]:
    return list(style.CRITERION_LOOKS).index(pair[0]), pair[1]


def _shares(found: xr.Dataset, pair: tuple[str, float]) -> Array:
    """Return the share of each cell's members that pass, not-a-number where the sweep was not asked, shape (cell,)."""
    if pair not in _asked(found):
        return np.full(found.sizes["cell"], np.nan)
    return np.asarray(found.pass_fraction.values[_asked(found).index(pair)])


def _cells(panel: Any, found: xr.Dataset, shares: Array) -> PolyCollection:
    panel.set(xscale="log", yscale="log")
    look: Any = {"norm": Normalize(0, 1), "cmap": "cividis", "antialiased": False, "rasterized": True, "zorder": 1}
    drawn = PolyCollection(list(_rectangles(found)), array=shares, **look)
    panel.add_collection(drawn)
    panel.grid(visible=False)
    if np.isnan(shares).all():
        panel.text(0.5, 0.5, "not asked of this sweep", transform=panel.transAxes, ha="center", color=style.QUIET)
    return drawn


def _rectangles(found: xr.Dataset) -> Array:
    """Return the corners of each cell, in stiffness and ωh, shape (cell, 4, 2)."""
    stiffness, omega_h = found.cell_stiffness.values, found.cell_omega_h.values
    corners = np.empty((len(stiffness), 4, 2))
    columns, column_of = np.unique(stiffness, return_inverse=True)
    by_column = np.argsort(column_of, kind="stable")
    starts = np.searchsorted(column_of[by_column], np.arange(1, len(columns)))
    sides = style.borders(columns, logarithmic=True)
    for cells, left, right in zip(np.split(by_column, starts), sides[:-1], sides[1:], strict=True):
        ends = style.borders(omega_h[cells], logarithmic=True)
        corners[cells, :, 0] = left, right, right, left
        corners[cells, :, 1] = np.stack([ends[:-1], ends[:-1], ends[1:], ends[1:]], axis=1)
    return corners


def _theory(panel: Any, found: xr.Dataset, *, numbered: bool) -> None:
    """Draw the limit, and ticks on the right at the magic steps, with their n if `numbered`."""
    panel.axhline(linear_theory.STABILITY_LIMIT, color="white", linestyle="--", linewidth=1.0)
    style.plain_log_ticks(panel.yaxis)
    magic = linear_theory.magic_steps(found.cell_omega_h.values.min(), found.cell_omega_h.values.max(), _LAST)
    right = panel.secondary_yaxis("right")
    right.set_yticks(list(magic.values()), [str(n) if numbered and n <= _NUMBERED else "" for n in magic])
    right.minorticks_off()
    right.tick_params(labelsize=7.5)
    if numbered:
        right.set_ylabel("magic steps, by n [1]", fontsize=7.5)


def _named(found: xr.Dataset) -> str:
    """Return what one column shows, in two lines."""
    ground = scene_of(found)["ground"]
    numbers = ground_words(damping=ground["damping"], friction=ground["friction"])
    return f"{found.attrs['model']}, {style.law_of(found)}\n{numbers}"
