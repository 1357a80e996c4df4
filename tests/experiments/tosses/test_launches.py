"""What the data say before contact: the unit of length, the tracker's error, and launches."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests import toss_files

from stiffdice.errors import InputError
from stiffdice.experiments.tosses import launches
from stiffdice.scene.tosses import Tosses

GRAVITY = 9.8
COUNT, SAMPLES, REST = 40, 20, 5
UP = np.array([0.0, 0.0, 1.0])


def flights(noise: float = 0.0, turn: float = 0.0) -> Tosses:
    """Free flights of 20 samples, high above the board, then five at rest; noise [m], turn [rad]: of a sample."""
    random = np.random.default_rng(1)
    time = np.arange(SAMPLES) / 148
    place, speed = random.normal(UP, 0.1, (COUNT, 3)), random.normal(0, 1, (COUNT, 3))
    start, spin = Rotation.random(COUNT, random).as_matrix(), random.normal(0, 4, (COUNT, 3))
    positions, orientations = [], []
    for k in range(COUNT):
        fallen = place[k] + speed[k] * time[:, None] - 0.5 * GRAVITY * time[:, None] ** 2 * UP
        turned = Rotation.from_rotvec(spin[k] * time[:, None]) * Rotation.from_matrix(start[k])
        shaken = Rotation.from_rotvec(random.normal(0, turn, (SAMPLES, 3))) * turned
        positions += [fallen + random.normal(0, noise, (SAMPLES, 3)), np.tile([0.0, 0.0, 0.05], (REST, 1))]
        orientations += [shaken.as_matrix(), np.tile(np.eye(3), (REST, 1, 1))]
    counts = np.full(COUNT, SAMPLES + REST)
    given = speed + 0.02, spin + 0.2
    return Tosses(148.0, 0.05, 0.37, 8e-4, counts, np.concatenate(positions), np.concatenate(orientations), *given)


def test_a_flight_is_known_up_to_the_board():
    assert (launches.flight_counts(flights()) == SAMPLES - 1).all()


def test_the_fit_to_an_exact_flight_is_its_launch():
    tosses = flights()
    found = launches.launches_of(tosses, "flight", GRAVITY)
    np.testing.assert_allclose(found.velocity, tosses.velocity - 0.02, atol=1e-11)
    np.testing.assert_allclose(found.angular_velocity, tosses.angular_velocity - 0.2, atol=1e-9)
    np.testing.assert_allclose(found.position, tosses.position[tosses.first], atol=1e-12)
    np.testing.assert_allclose(found.orientation, tosses.orientation[tosses.first], atol=1e-10)


def test_the_first_sample_is_taken_as_it_is():
    tosses = flights()
    found = launches.launches_of(tosses, "sample", GRAVITY)
    np.testing.assert_array_equal(found.velocity, tosses.velocity)
    np.testing.assert_array_equal(found.position, tosses.position[tosses.first])


def test_the_trackers_error_is_what_was_put_in():
    """Standard errors of 40 flights of 19 samples: 2 %."""
    found = launches.tracker_of(flights(1e-4, 1e-3), GRAVITY)
    assert found.position == pytest.approx(1e-4, rel=0.06)
    assert found.orientation == pytest.approx(1e-3, rel=0.06)
    assert found.velocity == pytest.approx(0.02, rel=0.1)
    assert found.angular_velocity == pytest.approx(0.2, rel=0.1)


@pytest.mark.parametrize("source", launches.SOURCES)
def test_perturbed_launches_are_as_far_off_as_fitted_ones(source):
    """The errors of fits to noisy flights are those that `perturbed` draws; of first samples those of the tracker."""
    random, tracker = np.random.default_rng(2), launches.Tracker(1e-4, 1e-3, 0.02, 0.2)
    tosses, exact = flights(1e-4, 1e-3), launches.launches_of(flights(), "flight", GRAVITY)
    drawn = [launches.perturbed(tosses, exact, source, tracker, 1.0, random) for _ in range(20)]
    spread = {name: np.std([getattr(one, name) - getattr(exact, name) for one in drawn]) for name in _RATES}
    if source == "flight":
        found = launches.launches_of(tosses, "flight", GRAVITY)
        wanted = {name: np.std(getattr(found, name) - getattr(exact, name)) for name in _RATES}
    else:
        wanted = {"position": 1e-4, "velocity": 0.02, "angular_velocity": 0.2}
    for name in _RATES:  # of 120 numbers a standard deviation is known to 6.5 %
        assert spread[name] == pytest.approx(wanted[name], rel=0.25), name


_RATES = "position", "velocity", "angular_velocity"


def test_nothing_is_perturbed_by_no_error():
    tosses = flights()
    exact = launches.launches_of(tosses, "flight", GRAVITY)
    tracker = launches.tracker_of(flights(1e-4, 1e-3), GRAVITY)
    for source in launches.SOURCES:
        same = launches.perturbed(tosses, exact, source, tracker, 0.0, np.random.default_rng(1))
        for one, other in zip(same, exact, strict=True):
            np.testing.assert_array_equal(one, other)


def test_another_unit_of_length_is_found_by_the_cube_at_rest_and_by_its_fall():
    found, unit = launches.calibrated(flights().in_units_of(1 / 1.02), GRAVITY)
    assert unit.length == pytest.approx(1.02, rel=1e-12)
    assert unit.fall == pytest.approx(GRAVITY, rel=1e-9)
    np.testing.assert_allclose(found.position, flights().position, rtol=1e-12)


@pytest.mark.long
def test_the_real_tosses_are_stored_two_per_cent_too_short():
    """The cube's height at rest says so, and its fall: two measurements that have nothing in common."""
    tosses, unit = launches.measured(str(toss_files.REAL), GRAVITY)
    assert (unit.length, unit.length_error) == (pytest.approx(1.0224, abs=1e-4), pytest.approx(3.5e-4, rel=0.05))
    assert unit.fall == pytest.approx(9.820, abs=2e-3)
    assert unit.fall_error == pytest.approx(0.005, rel=0.1)
    tracker = launches.tracker_of(tosses, GRAVITY)
    assert tracker.position == pytest.approx(6.6e-5, rel=0.02)


def test_a_cube_of_another_size_is_refused():
    tosses = flights()._replace(half_width=0.1)
    with pytest.raises(InputError, match=r"half_width = 0.1: the cube at rest is 0.05 m high; allowed is"):
        launches.calibrated(tosses, GRAVITY)


def test_tosses_that_never_fly_tell_no_error():
    tosses = flights()
    tosses.position[:, 2] = 0.05
    with pytest.raises(InputError, match="no toss flies for 6 samples"):
        launches.tracker_of(tosses, GRAVITY)
