from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiffdice.errors import InputError
from stiffdice.scene.ground import Ground

parts = st.floats(-1e150, 1e150)


def test_normal_is_normalised_as_in_the_listings():
    normal = Ground(normal=(1, 2, -2)).normal
    assert normal == (1 / 3, 2 / 3, -2 / 3)


@given(st.tuples(parts, parts, parts).filter(lambda normal: max(map(abs, normal)) > 1e-300))
def test_any_direction_gets_length_one_and_keeps_it(normal):
    once = Ground(normal=normal).normal
    assert math.hypot(*once) == pytest.approx(1, rel=1e-15)
    assert Ground(normal=once).normal == once


@pytest.mark.parametrize("normal", [(0, 0, 0), (0, 0), (0, 0, math.inf), "up", (0, 0, None), (0, 0, 0, 1)])
def test_no_direction_is_refused(normal):
    with pytest.raises(InputError, match=r"ground\.normal"):
        Ground(normal=normal)


@pytest.mark.parametrize("key", ["stiffness", "damping", "friction"])
@pytest.mark.parametrize("value", [-1e-300, math.nan, math.inf, "1", None, [1]])
def test_constants_are_finite_and_not_negative(key, value):
    with pytest.raises(InputError, match=rf"ground\.{key} = .*allowed is a finite number >= 0"):
        Ground(**{key: value})


def test_zero_is_a_ground():
    assert Ground(stiffness=0, damping=0, friction=0).stiffness == 0.0


def test_contact_law_is_one_of_two():
    with pytest.raises(InputError, match=r"ground\.contact = sticky: allowed is ungated or gated"):
        Ground(contact="sticky")
