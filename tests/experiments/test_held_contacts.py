"""Corners held by friction: the scheme `event` against LSODA."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments import held_contacts
from stiffdice.report.figures import resting as drawing
from stiffdice.report.figures import style
from stiffdice.scene.scene import Scene, from_mapping

FRICTION, STIFFNESS, TOLERANCE = (0.0, 1.0), (1e4, 1e8), (1e-6, 1e-9, 1e-12)


@pytest.fixture(scope="module")
def dataset():
    launch = {"position": [0, 0, 2], "velocity": [2.6, -1.7, 1.4], "angular_momentum": [0, 0.3, 1.3]}
    scene = from_mapping({"launch": launch, "ground": {"damping": 1.0}, "duration": 1.5})
    return held_contacts.measure(scene, friction=FRICTION, stiffness=STIFFNESS, tolerance=TOLERANCE, launches=4)


@pytest.mark.long
def test_the_error_falls_with_the_tolerance_as_far_as_lsoda_can_tell(dataset):
    assert dataset.reference_error.max() < 1e-8
    for tolerance in TOLERANCE:
        assert (
            dataset.error.sel({"tolerance": tolerance}) < 30 * tolerance + 5 * dataset.reference_error + 1e-10
        ).all()


@pytest.mark.long
def test_a_held_corner_costs_more_and_less_than_by_lsoda(dataset):
    smooth, rough = dataset.evaluations.sel({"tolerance": 1e-9}).median(["launch", "stiffness"])
    assert rough > 3 * smooth
    assert (dataset.evaluations.sel({"tolerance": 1e-9}) < dataset.reference_evaluations).all()


def test_a_column_is_drawn_for_each_friction(dataset):
    with style.applied():
        panels = drawing.held_contacts({"held": dataset}, "A title").axes
    assert len(panels) == 2 * len(FRICTION)
    for f, (upper, lower) in enumerate(zip(panels[: len(FRICTION)], panels[len(FRICTION) :], strict=True)):
        for panel, values in ((upper, dataset.error), (lower, dataset.evaluations)):
            drawn = [np.asarray(line.get_ydata()) for line in panel.get_lines()]
            for s in range(len(STIFFNESS)):
                assert any(np.array_equal(line, values[f, s].median("launch")) for line in drawn)
                assert any(np.array_equal(line, values[f, s].max("launch")) for line in drawn)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"friction": (-1.0,)}, "friction = -1"),
        ({"stiffness": (0.0,)}, "stiffness = 0"),
        ({"tolerance": (1e-15,)}, "tolerance = 1e-15"),
        ({"launches": 0}, "launches = 0"),
    ],
)
def test_numbers_out_of_range_are_told(options, told):
    with pytest.raises(InputError, match=told):
        held_contacts.measure(Scene(), **options)
