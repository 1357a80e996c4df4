from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest

from stiffdice import precision
from stiffdice.errors import InputError
from stiffdice.experiments.precision import LARGEST, LIMITS, measure
from stiffdice.io.enums import meanings_of
from stiffdice.scene import Scene, from_mapping

OTHER = {"cube": {"mass": 0.3, "geometry": "exact"}, "launch": {"position": [0, 0, 7], "velocity": [0, 0, 2]}}


@pytest.fixture(scope="module")
def measured():
    return measure(Scene())


def by_name(dataset, which):
    return dict(zip(meanings_of(dataset.limit), dataset[which].values.tolist(), strict=True))


@pytest.mark.parametrize("keys", [{}, OTHER], ids=["paper", "another"])
def test_every_limit_is_found_where_its_formula_says(keys, measured):
    dataset = measured if not keys else measure(from_mapping(keys))
    predicted, found = by_name(dataset, "predicted"), by_name(dataset, "measured")
    assert list(predicted) == list(LIMITS)
    for name, value in predicted.items():
        rough = {"growth": 0.15, "spring_at_deepest": 1e-4}
        assert found[name] == pytest.approx(value, rel=rough.get(name, 1e-6)), name


def test_the_papers_limits(measured):
    found = by_name(measured, "measured")
    assert found["spring_at_rest"] == pytest.approx(9.8**2 / 8 / 2**-51, rel=1e-6)
    assert found["sag_in_height"] == pytest.approx(9.8 / 4 / 2**-54, rel=1e-6)
    assert found["way_in_place"] == pytest.approx(2**-52 / 5, rel=1e-6)
    assert found["pull_in_speed"] == pytest.approx(2**-51 / 9.8, rel=1e-6)
    assert found["first_fall"] == pytest.approx(np.sqrt(2**-52 / 9.8), rel=1e-6)
    assert found["square_of_frequency"] == pytest.approx(LARGEST / 4, rel=1e-6)
    assert found["spring_at_deepest"] > 1e16


@pytest.mark.parametrize("omega_h", [0.2, 0.7])
def test_round_off_grows_in_a_bounce_with_the_step(omega_h):
    dataset = measure(Scene(), omega_h=omega_h)
    assert by_name(dataset, "measured")["growth"] == pytest.approx(by_name(dataset, "predicted")["growth"], rel=0.15)


def test_the_table_tells_every_limit_twice(measured):
    told = precision.table({"precision": measured}, "A title")
    assert told.markdown.startswith("# A title\n")
    heading, *rows = csv.reader(io.StringIO(told.csv))
    assert heading == ["limit", "formula", "predicted", "measured", "unit"]
    assert len(rows) == len(LIMITS)
    assert [row[4] for row in rows].count("s") == 3
    assert rows[0][2:4] == ["2.7×10¹⁶", "2.7×10¹⁶"]
    assert "S = 10⁶ kg/s² and ωh = 0.3, 66,667 steps in 10 s" in told.markdown
    assert json.loads(measured.attrs["scene"])["ground"]["contact"] == "gated"


@pytest.mark.parametrize(
    ("scene", "options", "told"),
    [
        ({"gravity": 0}, {}, "allowed are launches up"),
        ({"launch": {"velocity": [0, 0, -1]}}, {}, "allowed are launches up"),
        ({}, {"omega_h": 1.5}, "omega_h < 1"),
        ({}, {"members": 0}, "members = 0"),
    ],
)
def test_what_cannot_be_measured_is_said(scene, options, told):
    with pytest.raises(InputError, match=told):
        measure(from_mapping(scene), **options)
