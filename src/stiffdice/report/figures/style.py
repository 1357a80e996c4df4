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
from matplotlib.colors import LinearSegmentedColormap, to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.textpath import TextPath
from matplotlib.ticker import LogLocator, NullLocator

from stiffdice.errors import printable
from stiffdice.io.cf_enums import meanings_of

# Okabe and Ito, "Color Universal Design" (2008), ordered by lightness in grey.
BLUE, VERMILION, GREEN, ORANGE, SKY, YELLOW = "#0072B2", "#D55E00", "#009E73", "#E69F00", "#56B4E9", "#F0E442"
# Tol, "Colour schemes" (2021): those that the above leave room for.
PURPLE, OCHRE, SAND = "#AA4499", "#997700", "#DDCC77"
RUST = "#8C2D04"
INK, QUIET, GREY, FAINT, PALE, PAPER = "#222222", "#6e6e6e", "#a9a9a9", "#d9d9d9", "#f7f7f7", "#ffffff"
EARTH = "#f3eee4"  # the ground in space

# Of numbers, each as light as it is large: shares of members, scanned cells, a loss, and gains above zero above losses.
SHARES, CELLS, LOSS = "cividis", "Greys", "viridis_r"
GAINS = LinearSegmentedColormap.from_list("gains", ("#08214f", "#2f63a6", "#9c9c9c", "#f3b56b", "#fff6dc"))
_ORDERED = "viridis"

# Widths of figures: of a column and of a page [inch]; at these, text is readable. And its least size [points].
COLUMN, PAGE = 85 / 25.4, 180 / 25.4
SMALL = 6.0

# Of a contact law, and so of the presets that differ by it.
_UNGATED, _GATED = BLUE, ORANGE
LAW_COLORS = {"ungated": _UNGATED, "gated": _GATED}
PRESET_LOOKS: dict[str, dict[str, Any]] = {
    "as_listed": {"color": _UNGATED, "label": "as listed", "zorder": 3},
    "as_written": {"color": _GATED, "label": "as written", "zorder": 2, "linewidth": 1.8},
    "corrected": {"color": GREEN, "label": "corrected", "zorder": 2.5, "linestyle": "--"},
}

# Of a scheme, a solver or an engine: colour and mark. Schemes are drawn full, what is not ours is dashed.
METHOD_LOOKS: dict[str, dict[str, Any]] = {
    "symplectic_euler": {"color": BLUE, "marker": "o"},
    "forward_euler": {"color": ORANGE, "marker": "v"},
    "velocity_verlet": {"color": SKY, "marker": "s"},
    "rk4": {"color": PURPLE, "marker": "D"},
    "implicit_euler": {"color": OCHRE, "marker": "^"},
    "exact": {"color": GREEN, "marker": "*"},
    "event": {"color": VERMILION, "marker": "P"},
    "scipy_dop853": {"color": QUIET, "marker": "<"},
    "scipy_lsoda": {"color": INK, "marker": ">"},
    "scipy_radau": {"color": GREY, "marker": "x"},
    "mujoco": {"color": RUST, "marker": "d"},
    "mujoco_default": {"color": RUST, "marker": "1"},
    "pybullet": {"color": ORANGE, "marker": "h"},
    "drake": {"color": PURPLE, "marker": "p"},
    "drake_default": {"color": PURPLE, "marker": "2"},
    "dart": {"color": OCHRE, "marker": "H"},
    "scipy": {"color": INK, "marker": "8"},
    "octave": {"color": GREEN, "marker": "X"},
    "numpy": {"color": VERMILION, "marker": "+"},
}

# Of things without a colour of their own, as the dice of a study: colour and mark.
SERIES: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "marker": "o"},
    {"color": ORANGE, "marker": "s"},
    {"color": VERMILION, "marker": "D"},
    {"color": PURPLE, "marker": "^"},
    {"color": GREEN, "marker": "v"},
)

# Of what theory says.
THEORY: dict[str, Any] = {"color": INK, "linestyle": "--", "linewidth": 0.9}

STIFFNESS, OMEGA_H = "stiffness S [kg/s²]", "ωh of a flat landing [1]"
LAW_NAMES = {"ungated": "as listed (ungated)", "gated": "as written (gated)"}

# Of a criterion: colour, line, and the marks of first pass and last fail.
CRITERION_LOOKS: dict[str, dict[str, str]] = {
    "finite": {"color": QUIET, "line": ":", "first": "P", "last": "X"},
    "energy": {"color": BLUE, "line": "-", "first": "v", "last": "^"},
    "apex": {"color": VERMILION, "line": "-", "first": "s", "last": "D"},
    "restitution": {"color": GREEN, "line": "--", "first": "o", "last": "p"},
    "trajectory": {"color": PURPLE, "line": "-.", "first": "<", "last": ">"},
}
# Of a verdict, from mild to grave: colour, and a hatch where another is as light in grey.
VERDICT_LOOKS: dict[str, dict[str, str]] = {
    "passed": {"color": PALE},
    "unresolved": {"color": PALE, "hatch": "....."},
    "off_trajectory": {"color": SAND},
    "restitution_off": {"color": GREEN},
    "apex_rose": {"color": YELLOW},
    "energy_grew": {"color": ORANGE},
    "sank": {"color": SKY, "hatch": "\\\\\\\\"},
    "undecided": {"color": PAPER, "hatch": "//////"},
    "stalled": {"color": PURPLE, "hatch": "....."},
    "deep": {"color": BLUE},
    "blew_up": {"color": RUST},
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


SETTINGS: Any = {
    "figure.constrained_layout.use": True,
    "figure.titlesize": 8,
    "font.family": "DejaVu Sans",  # which comes with matplotlib
    "font.size": 7,
    "mathtext.fontset": "dejavusans",
    "axes.titlesize": 7,
    "axes.titlelocation": "left",
    "axes.labelcolor": INK,
    "axes.edgecolor": QUIET,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "grid.color": FAINT,
    "grid.linewidth": 0.5,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "lines.linewidth": 1.0,
    "legend.frameon": False,
    "legend.fontsize": 6.5,
    "legend.title_fontsize": SMALL,
    "hatch.linewidth": 0.5,
    "path.simplify": True,
    "svg.hashsalt": "stiffdice",  # the same figure gives the same file
    "svg.fonttype": "path",
}


@contextmanager
def applied() -> Iterator[None]:
    """Draw in the project's look, off screen, within this block."""
    mpl.use("agg")
    with mpl.rc_context(SETTINGS):
        yield


def new_figure(title: str, width: float = COLUMN, height: float = 2.4) -> Figure:
    """Return an empty figure as wide as a column or a page, sizes in inches."""
    figure = Figure(figsize=(width, height))
    text = printable(" ".join(title.split()))  # no formula: a `$` is a `$`
    figure.suptitle(_wrapped(text, 17 * width), x=0.01, ha="left", color=INK, parse_math=False)
    return figure


def add_note(figure: Figure, text: str) -> None:
    """Write a quiet line under the panels, above the legend if there is one, in as many as it takes: what was run."""
    text = _fitting(text, figure.get_figwidth())
    if figure.legends:
        (legend,) = figure.legends
        legend.set_title("\n".join(filter(None, (text, legend.get_title().get_text()))))
    else:
        figure.supxlabel(text, x=0.01, ha="left", fontsize=SMALL, color=QUIET)


def add_legend(figure: Figure, handles: Sequence[Any], title: str = "") -> None:
    """Put a legend below all panels, where it covers nothing, in as many columns as there is room for."""
    width = figure.get_figwidth()
    labels = [_wrapped(str(handle.get_label()), 20 * width - 8) for handle in handles]
    longest = max(len(line) for label in labels for line in label.splitlines())
    columns = min(len(labels), max(1, int(22 * width / (longest + 9))))
    look: dict[str, Any] = {"columnspacing": 1.2, "handlelength": 2.2}
    title = _fitting(title, width)
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, title=title, **look)


def _fitting(text: str, width: float) -> str:
    """Return a small text in lines that are no longer than a figure of this width [in]."""
    for letters in range(int(23 * width), 1, -1):
        lines = _wrapped(text, letters)
        widths = (TextPath((0, 0), line, size=SMALL).get_extents().width for line in lines.splitlines())
        if max(widths, default=0.0) <= 70 * width:  # of 72 points an inch
            break
    return lines


def _wrapped(text: str, width: float) -> str:
    """Return a text in lines of so many letters at most; one that fits stays as it is."""
    return text if len(text) <= width else textwrap.fill(text, int(width))


def ordered(count: int) -> list[dict[str, Any]]:
    """Return a look for each of so many numbers in order: colours from dark to light, and marks."""
    colors = mpl.colormaps[_ORDERED](np.linspace(0, 0.85, count))
    return [{"color": to_hex(color), "marker": "osD^vP"[k % 6]} for k, color in enumerate(colors)]


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
    panel.annotate(text, place, xytext=offset, textcoords="offset points", **{"fontsize": SMALL} | look)


def write_in_corner(panel: Any, x: float, text: str, **look: Any) -> None:
    """Write a small text at the top of a panel, x from 0 to 1: on its left half to the right, else to the left."""
    side = "left" if x < 0.5 else "right"
    panel.text(x, 0.96, text, transform=panel.transAxes, **{"ha": side, "va": "top", "fontsize": SMALL} | look)


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
    top.tick_params(labelsize=SMALL)
    return top
