"""All figures as a set: readable at the width they are drawn at, in grey, too, and as they were."""

from __future__ import annotations

import ast
from itertools import combinations, pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.collections import Collection
from matplotlib.colors import is_color_like, to_rgb
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from tests.report.figures.drawing import drawn
from tests.report.figures.samples import SAMPLES

from stiffdice.report import figures
from stiffdice.report.figures import style
from stiffdice.report.figures.registry import Animation
from stiffdice.study.catalogue import DRAWINGS

# RMS over all pixels, of 255. Equal data give equal pixels where matplotlib is the locked one; a line that is missing
# makes 1.7 at least in the pictures tried, most make 3 to 11.
TOLERANCE = 1.0
BASELINE = str(Path(__file__).parents[1] / "baseline")
FIGURES = [name for name in DRAWINGS if not name.endswith("animation")]
LEAST_LIGHTNESS = 6.0  # of 100, between two areas that only their colour tells apart


def test_there_is_a_sample_for_every_drawing():
    assert set(SAMPLES) == set(DRAWINGS)


@pytest.mark.long
@pytest.mark.mpl_image_compare(
    baseline_dir=BASELINE,
    style=style.SETTINGS,
    savefig_kwargs={"dpi": 36, "metadata": {"Software": None}},
    tolerance=TOLERANCE,
)
@pytest.mark.parametrize("name", FIGURES)
def test_each_figure_is_readable_and_as_it_was(name):
    figure = drawn(name, SAMPLES[name]())
    with mpl.rc_context(style.SETTINGS):
        figure.draw_without_rendering()  # places every text
        assert figure.get_figwidth() in (style.COLUMN, style.PAGE)
        assert min(text.get_fontsize() for text in texts_of(figure)) >= style.SMALL
        assert not clipped(figure)
        assert not crowded(figure)
        assert not covered(figure)
    return figure


@pytest.mark.parametrize("name", ["animation", "toss-animation"])
@pytest.mark.long
def test_each_animation_is_readable(name):
    animation = drawn(name, SAMPLES[name]())
    assert isinstance(animation, Animation)
    assert min(text.get_fontsize() for text in texts_of(animation.figure)) >= style.SMALL


def texts_of(figure):
    return [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]


def clipped(figure):
    """The texts that reach beyond the figure by more than a pixel; tick labels, some of which are not drawn, apart."""
    whole, apart = figure.bbox.padded(1.0), every_tick(figure)
    for axes in figure.axes:
        apart |= set() if axes.get_visible() else set(axes.findobj(Text))
    return [
        text.get_text()
        for text in texts_of(figure)
        if text not in apart and not all(whole.contains(*corner) for corner in text.get_window_extent().corners())
    ]


def every_tick(figure):
    axes = [panel for part in figure.axes for panel in (part, *part.child_axes)]
    return {label for panel in axes for axis in panel._axis_map.values() for label in axis.get_ticklabels(which="both")}


def crowded(figure):
    """The tick labels of an axis that lie on each other."""
    found = []
    for axes in figure.axes:
        if axes.name == "3d" or not axes.get_visible():
            continue
        for axis in (axes.xaxis, axes.yaxis):
            labels = [tick.label1 for tick in axis._update_ticks() if tick.label1.get_visible()]
            labels = [label for label in labels if label.get_text().strip()]
            boxes = sorted((label.get_window_extent() for label in labels), key=lambda box: (box.x0, box.y0))
            found += [(axes, axis.axis_name) for one, next_ in pairwise(boxes) if Bbox.intersection(one, next_)]
    return found


def covered(figure):
    """The axes in which a legend lies on something drawn: a line, a mark, an area."""
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]
    boxes = [legend.get_window_extent().padded(-1.0) for legend in legends]
    return [axes for axes in figure.axes for box in boxes if lies_on(box, axes)]


def lies_on(box, axes):
    if axes.name == "3d" or not Bbox.intersection(box, axes.bbox):
        return False
    lines = any(
        line.get_path().transformed(line.get_transform()).intersects_bbox(box, filled=False) for line in axes.lines
    )
    areas = any(patch.get_window_extent().overlaps(box) for patch in axes.patches)
    return lines or areas or any(collection_on(box, part) for part in axes.collections)


def collection_on(box, part: Collection):
    places = part.get_offset_transform().transform(np.ma.filled(part.get_offsets(), np.nan))
    marks = np.any((places >= box.min) & (places <= box.max), axis=None) if len(places) > 1 else False
    paths = (path.transformed(part.get_transform()) for path in part.get_paths())
    return bool(marks) or any(path.intersects_bbox(box) for path in paths)


# What tells a thing from others of its table, beside the colour.
TABLES = {
    "METHOD_LOOKS": ("color", "marker"),
    "CRITERION_LOOKS": ("color", "first", "last"),
    "VERDICT_LOOKS": ("color", "hatch"),
    "PRESET_LOOKS": ("color",),
    "LAW_COLORS": (),
}


@pytest.mark.parametrize("table", TABLES)
def test_no_two_things_of_a_table_look_the_same(table):
    looks = getattr(style, table).values()
    told = [tuple(look.get(key) for key in TABLES[table]) if TABLES[table] else look for look in looks]
    assert len(set(told)) == len(told)


def test_without_colours_marks_tell_methods_and_criteria_apart():
    marks = [look["marker"] for look in style.METHOD_LOOKS.values()]
    assert len(set(marks)) == len(marks)
    edges = [look[edge] for look in style.CRITERION_LOOKS.values() for edge in ("first", "last")]
    assert len(set(edges)) == len(edges)
    assert len({look["marker"] for look in style.SERIES}) == len(style.SERIES)
    assert len({look["marker"] for look in style.ordered(6)}) == 6


def lightness(color):
    """The lightness L* of CIE 1976, from 0 to 100."""
    channels = np.array(to_rgb(color))
    linear = np.where(
        channels > 0.04045,
        ((channels + 0.055) / 1.055) ** 2.4,
        channels / 12.92,
    )
    luminance = float(linear @ (0.2126, 0.7152, 0.0722))
    return 116 * luminance ** (1 / 3) - 16 if luminance > 0.008856 else 903.3 * luminance


def test_in_grey_verdicts_differ_in_lightness_or_hatch():
    for (one, first), (other, second) in combinations(style.VERDICT_LOOKS.items(), 2):
        if first.get("hatch") == second.get("hatch"):
            assert abs(lightness(first["color"]) - lightness(second["color"])) >= LEAST_LIGHTNESS, (one, other)


@pytest.mark.parametrize("name", ["SHARES", "CELLS", "LOSS", "GAINS"])
def test_in_grey_a_map_of_colours_runs_one_way(name):
    colours = mpl.colormaps.get_cmap(getattr(style, name))(np.linspace(0, 1, 33))
    steps = np.diff([lightness(colour) for colour in colours])
    assert (np.sign(steps) == np.sign(steps[0])).all()


def test_numbers_in_order_get_lighter():
    shades = [lightness(look["color"]) for look in style.ordered(6)]
    assert (np.diff(shades) > 5).all()


def test_figures_take_their_colours_from_one_place():
    top = Path(figures.__file__).parent
    for path in top.rglob("*.py"):
        if path.name == "style.py":
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and len(node.value) > 1:
                text = node.value
                named = is_color_like(text) and text != "none" and not text.replace(".", "").isdigit()
                assert not named and text not in mpl.colormaps, f"{path.name}:{node.lineno}: {text}"
