"""The figure of impacts of spheres."""

from __future__ import annotations

import pytest
from tests.report.figures.drawing import check_equal_files, check_units, drawn

from stiffdice.experiments import granular
from stiffdice.scene.scene import Scene


@pytest.fixture(scope="module")
def measured():
    return {"impacts": granular.impacts(Scene(), step=[0.1, 0.5, 1.0], phases=8)}


def test_least_and_largest_restitution_of_each_force_are_drawn(measured):
    figure = drawn("granular-impacts", measured)
    check_units(figure)
    drawn_lines = [list(line.get_ydata()) for line in figure.axes[0].get_lines()]
    for ends in (measured["impacts"].least, measured["impacts"].largest):
        assert all(row.values.tolist() in drawn_lines for row in ends)


@pytest.mark.long
def test_files_are_equal(measured, tmp_path):
    check_equal_files("granular-impacts", measured, tmp_path)
