from __future__ import annotations

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments import energy_budget
from stiffdice.scene.scene import Scene


@pytest.fixture(scope="module")
def books():
    stiff = Scene().with_ground(stiffness=1e6)
    return energy_budget.measure(stiff, steps=[20_000, 23_000, 100_000], bounces=4)


def test_a_lucky_number_of_steps_makes_less_than_a_larger_one(books):
    """The paper's 20,000 steps are a magic step: 15 % more make a hundred times as much of an error."""
    made = np.abs(books.scheme_work.values).max(axis=-1)
    assert (made[:, 0] < 0.03).all()
    assert (made[1, 1] > 100 * made[1, 0]) and (made[0, 1] > 20 * made[0, 0])
    assert (made[:, 2] < made[:, 1]).all()


def test_only_the_ungated_law_drags(books):
    assert (books.drag_work.values[1] == 0).all()
    assert (books.flight_drag_work.values[1] == 0).all()
    assert (books.flight_drag_work.values[0] < -30).all()


def test_damping_in_contact_hardly_counts(books):
    """ζ is 10⁻⁴ at S = 10⁶: e² falls by 2πζ, 0.13 % of the 41 J with which the cube comes down."""
    bounce = books.damping_work.values[1, 2, 0]
    assert bounce == pytest.approx(-2 * np.pi * 0.2 / 1e3 * 0.5 * 8.52**2, rel=0.05)


def test_a_run_without_so_many_bounces_is_padded():
    found = energy_budget.measure(Scene(), steps=[1000], bounces=200)
    assert np.isnan(found.scheme_work.values[..., -1]).all()
    assert np.isfinite(found.scheme_work.values[..., 0]).all()


def test_bad_options_are_named():
    with pytest.raises(InputError, match="steps = 0"):
        energy_budget.measure(Scene(), steps=[0])
