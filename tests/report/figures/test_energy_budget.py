from __future__ import annotations

import numpy as np
from tests.report.figures.drawing import drawn

from stiffdice.experiments.energy_budget import measure
from stiffdice.report.figures import style
from stiffdice.scene.scene import Scene


def test_every_bounce_is_drawn_where_it_is():
    books = measure(Scene().with_ground(stiffness=1e6), steps=[20_000, 23_000], bounces=3)
    figure = drawn("energy-budget", {"books": books})
    assert "[J]" in figure.axes[0].get_ylabel()
    assert "[1]" in figure.axes[-1].get_xlabel()
    for k, axes in enumerate(figure.axes):
        works = {
            style.QUIET: books.friction_work.values[k],
            style.BLUE: (books.damping_work + books.drag_work).values[k],
            style.VERMILION: books.scheme_work.values[k],
        }
        for color, values in works.items():
            marks = [line for line in axes.get_lines() if line.get_color() == color and line.get_marker() in ("^", "v")]
            shown = {line.get_marker(): np.sort(line.get_ydata()) for line in marks}
            np.testing.assert_array_equal(shown["^"], np.sort(values[values > 0]))
            np.testing.assert_array_equal(shown["v"], np.sort(-values[values < 0]))
