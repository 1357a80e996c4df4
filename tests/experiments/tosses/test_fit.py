"""Restitution and friction: those that made the tosses are found, on tosses that the fit has not seen."""

from __future__ import annotations

import numpy as np
import pytest
from tests import toss_files

from stiffdice.errors import InputError
from stiffdice.experiments.tosses import fit
from stiffdice.experiments.tosses.launches import Launches
from stiffdice.experiments.tosses.replay import Errors, Physics


@pytest.mark.parametrize("count", [2, 9, 342])
def test_a_third_is_fitted_and_the_others_are_told(count):
    fitted, others = fit.split(count, 18)
    assert len(fitted) == max(1, count // 3)
    assert sorted([*fitted, *others]) == list(range(count))
    assert count == 2 or not np.array_equal(fitted, fit.split(count, 19)[0])


def test_a_toss_that_is_far_off_counts_no_more_than_one_that_is_off():
    off = Errors(np.array([0.1, 0.5, 7.0, np.inf]), np.array([0.2, 3.0, 0.0, np.inf]))
    np.testing.assert_allclose(fit.loss_of(off), [0.3, 1.0, 0.5, 1.0])


@pytest.mark.long
def test_the_ground_that_made_the_tosses_is_found():
    """To the last spacing that is tried, 0.005, and beyond it by what steps of another size change."""
    physics = Physics(0.33, 0.225, 0.004)
    tosses, launches = toss_files.made(10, physics)
    found = fit.fit(tosses, launches, toss_files.SCENE, Physics(contact_time=0.004))
    assert found.restitution == pytest.approx(physics.restitution, abs=0.02)
    assert found.friction == pytest.approx(physics.friction, abs=0.006)
    assert found.loss < 0.05
    for best, (low, high) in (
        (found.restitution, found.restitution_interval),
        (found.friction, found.friction_interval),
    ):
        assert low <= best <= high


@pytest.mark.long
def test_tosses_of_the_simulator_are_told_right():
    physics = Physics(0.3, 0.2, 0.005)
    tosses, launches = toss_files.made(6, physics)
    told = fit.told(tosses, Launches(*launches), toss_files.SCENE, physics)
    assert told.path.max() < 1e-3
    assert told.orientation.max() < 0.01
    assert told.right.all()


def test_a_mean_is_within_its_interval_as_often_as_it_says():
    """Of 200 samples of 50 numbers: 95 ± 3 %."""
    random = np.random.default_rng(5)
    ends = [fit.interval(random.exponential(1.0, 50)) for _ in range(200)]
    assert np.mean([low <= 1 <= high for low, high in ends]) == pytest.approx(0.94, abs=0.04)


def test_bad_options_are_told(tmp_path):
    one = toss_files.stored(toss_files.some(1), tmp_path / "one.h5")
    for options, told in (
        ({"contact_time": [0.0]}, "contact_time = 0"),
        ({"data": str(tmp_path / "nothing.h5")}, "nothing.h5: No such file"),
        ({"data": str(one), "contact_time": [0.005]}, "one.h5: has one toss"),
    ):
        with pytest.raises(InputError, match=told):
            fit.measure(toss_files.SCENE, **options)


@pytest.fixture(scope="module")
def few(tmp_path_factory):
    return str(toss_files.stored(toss_files.some(6), tmp_path_factory.mktemp("tosses") / "few.h5"))


@pytest.mark.long
def test_measured_are_a_row_for_each_launch_and_contact_time(few):
    found = fit.measure(toss_files.SCENE, data=few, contact_time=(0.005, 0.01))
    assert dict(found.path.sizes) == {"source": 2, "contact_time": 2, "toss": 4}
    assert (found.restitution_low <= found.restitution).all()
    assert (found.restitution <= found.restitution_high).all()
    assert float(found.attrs["landscape_contact_time"]) == 0.005
    # The best that was tried is hardly worse than the best of the grid over which the loss is told.
    assert found.loss[0, 0] < float(found.landscape.min()) + 0.01
    assert all(variable.attrs["units"] for variable in found.variables.values())
