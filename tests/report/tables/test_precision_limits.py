from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments.precision_limits import LARGEST, measure
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.tables import precision_limits
from stiffdice.scene.scene import Scene, from_mapping

OTHER = {"cube": {"mass": 0.3, "geometry": "exact"}, "launch": {"position": [0, 0, 7], "velocity": [0, 0, 2]}}


@pytest.fixture(scope="module")
def measured():
    return measure(Scene())


def by_name(dataset, which):
    return dict(zip(meanings_of(dataset.limit), dataset[which].values.tolist(), strict=True))


@pytest.mark.parametrize("keys", [{}, OTHER], ids=["paper", "another"])
@pytest.mark.long
def test_every_limit_is_found_where_its_formula_says(keys, measured):
    dataset = measured if not keys else measure(from_mapping(keys))
    predicted, found = by_name(dataset, "predicted"), by_name(dataset, "measured")
    assert list(predicted) == list(precision_limits._ROWS)
    for name, value in predicted.items():
        rough = {"growth": 0.15, "spring_at_deepest": 1e-4}
        assert found[name] == pytest.approx(value, rel=rough.get(name, 1e-6)), name


@pytest.mark.long
def test_the_papers_limits_are_predicted_by_formula_and_found_by_bisection(measured):
    predicted, found = by_name(measured, "predicted"), by_name(measured, "measured")
    side = Scene().cube.side
    v, omega, omega_h = np.sqrt(25 + 2 * 9.8 * (3 - side / 2)), 2e3, 0.3
    deepest = 9.8 / omega**2 + np.hypot(9.8 / omega**2, v / omega)
    kappa = np.pi / (2 * np.arcsin(omega_h / 2)) % 1
    formulas = {
        "spring_at_rest": 9.8**2 / 8 / 2**-51,
        "sag_in_height": 9.8 / 4 / 2**-54,
        "way_in_place": 2**-52 / 5,
        "pull_in_speed": 2**-51 / 9.8,
        "first_fall": np.sqrt(2**-52 / 9.8),
        "square_of_frequency": LARGEST / 4,
        "spring_at_deepest": (v**2 / 2 + 9.8 * deepest) / 2**-50,
        "growth": v * omega * omega_h / 9.8 * (2 * (1 - kappa)) ** kappa * (2 * kappa) ** (1 - kappa),
    }
    assert {name: predicted[name] for name in formulas} == pytest.approx(formulas, rel=1e-13)
    for name, value in formulas.items():
        if name not in ("spring_at_deepest", "growth"):
            assert found[name] == pytest.approx(value, rel=1e-6), name
    assert found["growth"] != predicted["growth"]  # an average over runs is no formula


@pytest.mark.parametrize("omega_h", [0.2, 0.7])
@pytest.mark.long
def test_round_off_grows_in_a_bounce_with_the_step(omega_h):
    dataset = measure(Scene(), omega_h=omega_h)
    assert by_name(dataset, "measured")["growth"] == pytest.approx(by_name(dataset, "predicted")["growth"], rel=0.15)


def test_the_table_tells_every_limit_twice(measured):
    told = precision_limits.table({"precision": measured}, "A title")
    assert told.markdown.startswith("# A title\n")
    heading, *rows = csv.reader(io.StringIO(told.csv))
    assert heading == ["limit", "formula", "predicted", "measured", "unit"]
    assert len(rows) == len(precision_limits._ROWS)
    assert [row[4] for row in rows].count("s") == 3
    assert rows[0][2:4] == ["2.7×10¹⁶", "2.7×10¹⁶"]
    twice = precision_limits.table({"precision": measured.assign(measured=2 * measured.measured)}, "A title")
    assert list(csv.reader(io.StringIO(twice.csv)))[1][2:4] == ["2.7×10¹⁶", "5.41×10¹⁶"]
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
