"""What every figure's tests do: draw, and look at axes and files."""

from __future__ import annotations

import numpy as np

from stiffdice.report.figures import registry, style
from stiffdice.study.catalogue import DRAWINGS


def drawn(name, data):
    """The figure of the catalogue's drawing, not yet a file."""
    with style.applied():
        return DRAWINGS[name].load()(data, "A title")


def check_equal_files(name, data, folder):
    for copy in "ab":
        registry.draw(name, data, "A title", 80, [str(folder / f"{copy}.{kind}") for kind in registry.FORMATS])
    for kind in registry.FORMATS:
        assert (folder / f"a.{kind}").read_bytes() == (folder / f"b.{kind}").read_bytes()


def check_units(figure):
    """Every outer axis has a label with a unit."""
    for axes in figure.axes:
        spec = axes.get_subplotspec()
        if spec is None:  # a colour bar, or axes in space
            assert "[" in axes.get_xlabel() + axes.get_ylabel()
        else:
            assert "[" in axes.get_xlabel() or not spec.is_last_row(), axes
            assert "[" in axes.get_ylabel() or not spec.is_first_col(), axes


def lines_of(axes):
    """The points of labelled lines."""
    return {line.get_label(): np.asarray(line.get_xydata()) for line in axes.get_lines()}
