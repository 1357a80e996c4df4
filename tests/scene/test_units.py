"""A number with a unit is the number in SI, to the last bit; anything else is refused in words."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiffdice.errors import InputError
from stiffdice.scene import units, validation


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("16 mm", "m", 0.016),
        ("16.1mm", "m", 0.0161),
        (" 1.6 cm ", "m", 0.016),
        ("7 µm", "m", 7e-6),
        ("7 um", "m", 7e-6),
        ("5 g", "kg", 0.005),
        ("-2.5e-3 kg", "kg", -0.0025),
        ("1e4 N/m", "kg/s²", 1e4),
        ("35 kN/m", "kg/s²", 35e3),
        ("0.7 N/mm", "kg/s²", 700.0),
        ("0.2 kg/s", "kg/s", 0.2),
        ("0.3 N s/m", "kg/s", 0.3),
        ("0.3 N·s·m⁻¹", "kg/s", 0.3),
        ("50 cm/s", "m/s", 0.5),
        ("3.6 km/h", "m/s", 1.0),
        ("9.81 m/s^2", "m/s²", 9.81),
        ("9.81 m s-2", "m/s²", 9.81),
        ("9.81 m/s**2", "m/s²", 9.81),
        ("3 g mm²/s", "kg m²/s", 3e-9),
        ("3 J s", "kg m²/s", 3.0),
        ("30 deg", "rad", math.pi / 6),
        ("30°", "rad", math.pi / 6),
        ("10 ms", "s", 0.01),
        ("2 min", "s", 120.0),
    ],
)
def test_what_a_number_with_a_unit_is(text, unit, value):
    assert validation.number("x", text, unit) == pytest.approx(value, rel=2e-16)


@given(st.decimals(-(10**6), 10**6, places=7))
def test_a_prefix_moves_the_decimal_point_and_nothing_else(number):
    assert validation.number("x", f"{number:f} mm", "m") == float(number.scaleb(-3))
    assert validation.number("x", f"{number:e}km", "m") == float(number.scaleb(3))


@pytest.mark.parametrize("unit", sorted(units.EXAMPLES))
def test_every_quantity_has_an_example_that_is_read(unit):
    assert math.isfinite(validation.number("x", units.EXAMPLES[unit], unit))


@pytest.mark.parametrize(
    ("text", "unit", "told"),
    [
        ("5 mm", "kg", "x = 5 mm: mm is no unit of [kg]; allowed is a finite number [kg], or with a unit, as 5 g"),
        ("5 furlong", "m", "x = 5 furlong: furlong is no unit known here; allowed is"),
        ("5 /s", "m/s", "x = 5 /s: /s is no unit known here"),
        ("5 m/", "m", "x = 5 m/: m/ is no unit known here"),
        ("5 m", "1", "x = 5 m: it has no unit; allowed is a finite number [1]"),
        ("1e400 m", "m", "x = 1e400 m: allowed is a finite number"),
        ("1e99999999999 m", "m", "x = 1e99999999999 m: "),
        ("0,5", "kg", "x = 0,5: a decimal comma is not read; write 0.5; allowed is"),
        ("-0,5e3 g", "kg", "x = -0,5e3 g: a decimal comma is not read; write -0.5e3 g"),
        ("0,5", "1", "x = 0,5: a decimal comma is not read; write 0.5"),
        ("5", "kg", "x = the text '5': allowed is"),
        ("heavy", "kg", "x = the text 'heavy': allowed is"),
        ("5 " + 100 * " " + "m", "m", "x = the text '5 "),
    ],
)
def test_what_it_is_not_is_said_in_words(text, unit, told):
    with pytest.raises(InputError) as caught:
        validation.number("x", text, unit)
    assert str(caught.value).startswith(told)


@pytest.mark.parametrize(
    "value", [["1 mm", "2 mm", "-3 mm"], "[1, 2, -3] mm", " [ 1 ,2,-3 ]mm ", ["0.1 cm", "2e-3 m", "-3000 µm"]]
)
def test_a_vector_has_a_unit_for_each_number_or_one_for_all(value):
    assert validation.vector("x", value, "m") == (0.001, 0.002, -0.003)


def test_zeros_of_a_vector_need_no_unit_and_other_numbers_do():
    assert validation.vector("x", [0, 0.0, "3 cm"], "m") == (0, 0, 0.03)
    with pytest.raises(InputError, match=r"^x = \[1, 0, '3 cm'\]: give every number its unit, or none \[m\]$"):
        validation.vector("x", [1, 0, "3 cm"], "m")
    with pytest.raises(InputError, match=r"^x = \[0, 5, 0, 0\]: .*; write a decimal comma as a point"):
        validation.vector("x", [0, 5, 0, 0], "m")


@given(st.text(max_size=80), st.sampled_from([*sorted(units.EXAMPLES), "1", ""]))
def test_any_text_is_a_number_or_refused(text, unit):
    try:
        assert math.isfinite(validation.number("x", text, unit))
    except InputError as error:
        assert str(error).startswith("x = ")
