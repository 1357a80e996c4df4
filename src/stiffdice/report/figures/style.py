"""One look for every figure: colours that colour-blind readers and grey printers tell apart, units on axes."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullLocator

from stiffdice.errors import printable
from stiffdice.io.cf_enums import meanings_of

# Okabe and Ito, "Color Universal Design" (2008), ordered by lightness in grey.
BLUE, VERMILION, GREEN, ORANGE = "#0072B2", "#D55E00", "#009E73", "#E69F00"
INK, QUIET, FAINT = "#222222", "#6e6e6e", "#d9d9d9"

PRESET_LOOKS: dict[str, dict[str, Any]] = {
    "as_listed": {"color": BLUE, "label": "as listed", "zorder": 3},
    "as_written": {"color": ORANGE, "label": "as written", "zorder": 2, "linewidth": 2.0},
    "corrected": {"color": GREEN, "label": "corrected", "zorder": 2.5},
}

# Of what theory says.
THEORY: dict[str, Any] = {"color": INK, "linestyle": "--", "linewidth": 1.0}

STIFFNESS, OMEGA_H = "stiffness S [kg/s²]", "ωh of a flat landing [1]"
LAW_NAMES = {"ungated": "as listed (ungated)", "gated": "as written (gated)"}

# Of a criterion's edges: colour, and the marks of first pass and last fail.
PURPLE = "#AA4499"  # Tol, "Colour schemes" (2021): the fifth that the four above leave room for
CRITERION_LOOKS: dict[str, dict[str, str]] = {
    "finite": {"color": QUIET, "first": "P", "last": "X"},
    "energy": {"color": BLUE, "first": "v", "last": "^"},
    "apex": {"color": VERMILION, "first": "s", "last": "D"},
    "restitution": {"color": GREEN, "first": "o", "last": "p"},
    "trajectory": {"color": PURPLE, "first": "<", "last": ">"},
}
# Of a verdict, from mild to grave: colour, and a hatch, if any.
VERDICT_LOOKS: dict[str, dict[str, str]] = {
    "passed": {"color": "#ededed"},
    "unresolved": {"color": "#ededed", "hatch": "....."},
    "off_trajectory": {"color": "#CCBB44"},
    "restitution_off": {"color": GREEN},
    "apex_rose": {"color": "#F0E442"},
    "energy_grew": {"color": ORANGE},
    "sank": {"color": "#56B4E9"},
    "undecided": {"color": "#ffffff", "hatch": "//////"},
    "stalled": {"color": PURPLE},
    "deep": {"color": BLUE},
    "blew_up": {"color": "#B33C00"},
    "left_numeric_range": {"color": INK},
}

_CRITERION_WORDS = {
    "finite": "numbers stay finite",
    "energy": "airborne energy ≤ {0:g} E₀",
    "apex": "apex ≤ {0:g} × the one before",
    "restitution": "e within {1:g} of exact",
    "trajectory": "within {1:g} r of the reference",
}


def criterion_words(criterion: str, tolerance: float, hop_height: float | None = None) -> str:
    """Return what a criterion asks, in a few words; with the height [m] from which rebounds count, if given."""
    words = _CRITERION_WORDS[criterion].format(1 + tolerance, tolerance)
    return words if criterion != "apex" or hop_height is None else f"{words}, from {hop_height:g} m on"


_SETTINGS: Any = {
    "figure.constrained_layout.use": True,
    "figure.titlesize": 11,
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.labelcolor": INK,
    "axes.edgecolor": QUIET,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "xtick.color": INK,
    "ytick.color": INK,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "path.simplify": True,
    "svg.hashsalt": "stiffdice",  # the same figure gives the same file
    "svg.fonttype": "path",
}


@contextmanager
def applied() -> Iterator[None]:
    """Draw in the project's look, off screen, within this block."""
    mpl.use("agg")
    with mpl.rc_context(_SETTINGS):
        yield


def new_figure(title: str, width: float = 7.2, height: float = 4.4) -> Figure:
    """Return an empty figure, sizes in inches."""
    figure = Figure(figsize=(width, height))
    text = printable(" ".join(title.split()))  # of one line, and no formula: a `$` is a `$`
    figure.suptitle(text, x=0.01, ha="left", color=INK, parse_math=False)
    return figure


def add_note(figure: Figure, text: str) -> None:
    """Write a quiet line under a figure, in as many as it takes: what was run."""
    text = textwrap.fill(text, width=int(15 * figure.get_figwidth()))
    figure.supxlabel(text, x=0.01, ha="left", fontsize=7.5, color=QUIET)


def line(label: str, **look: Any) -> Line2D:
    """Return a line for a legend."""
    return Line2D([], [], label=label, **look)


def mark(label: str, marker: str, **look: Any) -> Line2D:
    """Return a mark without a line for a legend."""
    return Line2D([], [], label=label, linestyle="none", marker=marker, **look)


def area(label: str, color: str, **look: Any) -> Patch:
    """Return a coloured area for a legend."""
    return Patch(color=color, linewidth=0, label=label, **look)


def write_beside(panel: Any, text: str, place: tuple[float, float], offset: tuple[float, float], **look: Any) -> None:
    """Write a small text beside a place of a panel, so many points to the right of it and above."""
    panel.annotate(text, place, xytext=offset, textcoords="offset points", **{"fontsize": 8} | look)


def write_in_corner(panel: Any, x: float, text: str, **look: Any) -> None:
    """Write a small text at the top of a panel, x from 0 to 1: on its left half to the right, else to the left."""
    side = "left" if x < 0.5 else "right"
    panel.text(x, 0.96, text, transform=panel.transAxes, **{"ha": side, "va": "top", "fontsize": 8} | look)


def plain_log_ticks(axis: Any, multiples: Sequence[float] = (1.0, 2.0, 5.0)) -> None:
    """Label these multiples of each power of ten on a logarithmic axis, as 0.2 and not as 2×10⁻¹."""
    axis.set_major_locator(LogLocator(subs=multiples))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def by_law(found: Iterable[xr.Dataset]) -> list[xr.Dataset]:
    """Return a dataset for each contact law of sweeps or experiments."""
    return [part.isel(contact=k) for part in found for k in range(part.sizes["contact"])]


def broken_criteria(found: xr.Dataset) -> dict[str, xr.Dataset]:
    """Return what was found by each criterion that some member breaks in some cell."""
    by_name = {name: found.isel(criterion=c) for c, name in enumerate(meanings_of(found.criterion))}
    return {name: part for name, part in by_name.items() if float(part.pass_fraction.min()) < 1}


def law_of(found: xr.Dataset, contact: str = "contact") -> str:
    """Return the contact law of a dataset of one law, and who made its runs unless we did."""
    law = LAW_NAMES[meanings_of(found[contact])[int(found[contact].values.flat[0])]]
    simulator = found.attrs.get("simulator", "stiffdice")
    return law if simulator == "stiffdice" else f"{law}, {simulator}"


def borders(centres: npt.NDArray[np.float64], *, logarithmic: bool = False) -> npt.NDArray[np.float64]:
    """Return the borders of cells that reach half-way to their neighbours, sorted as `centres`, shape (cell + 1,).

    A cell alone reaches half a unit to either side, half an e-fold if logarithmic.
    """
    places = np.log(centres) if logarithmic else centres
    between = (places[1:] + places[:-1]) / 2
    below, above = (between[0] - places[0], places[-1] - between[-1]) if len(between) else (0.5, 0.5)
    whole = np.concatenate([[places[0] - below], between, [places[-1] + above]])
    return np.asarray(np.exp(whole) if logarithmic else whole)


def top_axis(panel: Any, ticks: Sequence[float], labels: Sequence[str]) -> Any:
    """Return a second axis on top of a panel, with labelled ticks at places of the first."""
    top = panel.secondary_xaxis("top")
    top.set_xticks(ticks, labels)
    top.minorticks_off()
    top.tick_params(labelsize=7.5)
    return top
