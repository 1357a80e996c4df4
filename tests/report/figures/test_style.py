"""What all figures share."""

from __future__ import annotations

import pytest

from stiffdice.report.figures import style


@pytest.mark.parametrize("width", [style.COLUMN, style.PAGE])
@pytest.mark.parametrize("text", ["WIDE MUM 4×10⁵ " * 20, "ill filli " * 40, "short"])
def test_a_note_is_no_wider_than_its_figure(width, text):
    with style.applied():
        figure = style.new_figure("a title", width)
        figure.subplots().plot([0, 1])
        style.add_legend(figure, [style.line("a line")], text)
        style.add_note(figure, text)
        figure.canvas.draw()
        note = figure.legends[0].get_title()
        box = note.get_window_extent()
    assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1
    assert note.get_text().split() == [*text.split(), *text.split()]
