"""One look for every figure: colours that colour-blind readers and grey printers tell apart, units on axes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

# Okabe and Ito, "Color Universal Design" (2008), ordered by lightness in grey.
BLUE, VERMILION, GREEN, ORANGE = "#0072B2", "#D55E00", "#009E73", "#E69F00"
INK, QUIET, FAINT = "#222222", "#6e6e6e", "#d9d9d9"

LISTED, WRITTEN = BLUE, ORANGE
PRESET_LOOKS: dict[str, dict[str, Any]] = {
    "as_listed": {"color": LISTED, "label": "as listed", "zorder": 3},
    "as_written": {"color": WRITTEN, "label": "as written", "zorder": 2, "linewidth": 2.0},
    "corrected": {"color": GREEN, "label": "corrected", "zorder": 2.5},
}

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
    figure.suptitle(title, x=0.01, ha="left", color=INK)
    return figure


def add_note(figure: Figure, text: str) -> None:
    """Write one quiet line under a figure: what was run."""
    figure.supxlabel(text, x=0.01, ha="left", fontsize=7.5, color=QUIET)
