"""One look for every figure: colours that colour-blind readers and grey printers tell apart, units on axes."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from stiffdice.errors import printable

# Okabe and Ito, "Color Universal Design" (2008), ordered by lightness in grey.
BLUE, VERMILION, GREEN, ORANGE = "#0072B2", "#D55E00", "#009E73", "#E69F00"
INK, QUIET, FAINT = "#222222", "#6e6e6e", "#d9d9d9"

LISTED, WRITTEN = BLUE, ORANGE
PRESET_LOOKS: dict[str, dict[str, Any]] = {
    "as_listed": {"color": LISTED, "label": "as listed", "zorder": 3},
    "as_written": {"color": WRITTEN, "label": "as written", "zorder": 2, "linewidth": 2.0},
    "corrected": {"color": GREEN, "label": "corrected", "zorder": 2.5},
}

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


def maker_of(found: Any) -> str:
    """Return who made the runs of a sweep, to come after its contact law; nothing if we did."""
    simulator = found.attrs["simulator"]
    return "" if simulator == "stiffdice" else f", {simulator}"


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
