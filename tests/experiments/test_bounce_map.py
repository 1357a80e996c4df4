from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError
from stiffdice.experiments import bounce_map
from stiffdice.io.writer import write_dataset
from stiffdice.scene.scene import from_mapping

STIFF = {"ground": {"stiffness": 1e6}}
PHASES = 200


@pytest.fixture(scope="module")
def measured():
    return bounce_map.measure(from_mapping(STIFF), count=150, phases=PHASES)


@pytest.fixture(scope="module")
def magic(measured):
    return measured.sel(omega_h=[2 * np.sin(np.pi / (2 * n)) for n in range(2, 158)])


@pytest.fixture(scope="module")
def half_way(measured):
    return measured.sel(omega_h=[2 * np.sin(np.pi / (2 * k + 1)) for k in range(1, 157)])


def largest(found):
    return found.energy_gain.max("phase")


def by_theory(found):
    return [linear_theory.largest_gain(value) - 1 for value in found.omega_h.values]


def stepped(omega_h, phase):
    """Return e² of a bounce from bare stepping, in units of the step and of the speed."""
    place, speed = phase.copy(), -np.ones_like(phase)
    for _ in range(4 + int(np.pi / omega_h)):
        speed = speed - omega_h**2 * np.minimum(place, 0)
        place = place + speed
    assert (place > 0).all()
    return speed**2


@pytest.mark.long
def test_the_map_is_what_bare_stepping_gives(measured):
    assert measured.energy_gain.dims == ("omega_h", "phase")
    assert (measured.omega_h[0], measured.omega_h[-1]) == (0.02, 1.98)
    np.testing.assert_array_equal(measured.phase, np.arange(PHASES) / PHASES)
    wanted = [stepped(value, measured.phase.values) - 1 for value in measured.omega_h.values]
    np.testing.assert_allclose(measured.energy_gain, wanted, rtol=0, atol=1e-11)


@pytest.mark.long
def test_no_bounce_gains_or_loses_more_than_the_bounds(measured):
    square = measured.omega_h**2 / 4
    assert (measured.energy_gain <= 1 / (1 - square) - 1 + 1e-11).all()
    assert (measured.energy_gain >= -square - 1e-11).all()


def test_half_way_between_magic_steps_the_bounds_are_attained(half_way):
    """By a node that touches the ground at a step, and by one that does so half a step later."""
    square = half_way.omega_h**2 / 4
    np.testing.assert_allclose(half_way.energy_gain.sel(phase=0.0), 1 / (1 - square) - 1, rtol=0, atol=1e-11)
    np.testing.assert_allclose(half_way.energy_gain.sel(phase=0.5), -square, rtol=0, atol=1e-11)


def test_above_the_first_of_them_the_bound_is_out_of_reach(measured):
    above = largest(measured.sel(omega_h=slice(1.8, None)))
    assert above.sizes["omega_h"] > 3
    assert (above < 0.99 * (1 / (1 - above.omega_h**2 / 4) - 1)).all()
    assert (above < 8).all()  # where the bound is 49
    assert largest(bounce_map.measure(from_mapping(STIFF), omega_h=(1.5, 1.9999), count=2))[-1] > 7.99


def test_the_largest_gain_is_at_phase_zero_and_the_known_one(measured):
    peak = measured.energy_gain.sel(phase=0.0)
    np.testing.assert_allclose(peak, largest(measured), rtol=0, atol=1e-11)
    np.testing.assert_allclose(peak, by_theory(measured), rtol=0, atol=1e-11)


def test_the_largest_loss_is_a_largest_gain_run_backwards(measured):
    """The phases may miss it by half of their spacing: in units of (ωh)², by that much for small ωh."""
    smallest = measured.energy_gain.min("phase")
    missed = (smallest - (1 / (1 + largest(measured)) - 1)) / measured.omega_h**2
    assert missed.min() > -1e-8
    assert missed.max() < 1 / PHASES


def test_for_small_steps_the_largest_change_is_known_from_where_half_a_period_ends(measured):
    """(ωh)² f(1 − f), f the fraction beyond whole steps: at most ¼(ωh)², which it comes to half-way."""
    small = measured.sel(omega_h=slice(None, 0.2))
    square = small.omega_h.values**2
    part = np.pi / (2 * np.arcsin(small.omega_h.values / 2)) % 1
    for change in (largest(small), np.abs(small.energy_gain.min("phase"))):
        assert np.abs(change / square - part * (1 - part)).max() < 0.015
        assert (change <= square / 4 * 1.011).all()
        assert (change / square).max() > 0.2499


def test_magic_steps_conserve_energy_at_every_phase(magic):
    np.testing.assert_allclose(magic.energy_gain, 0, atol=1e-11)


def test_only_magic_steps_do(measured):
    magic = 2 * np.sin(np.pi / (2 * np.arange(2, 160)))
    away = np.abs(measured.omega_h.values[:, None] / magic - 1).min(axis=1) > 1e-6
    assert away.sum() > 300 - 5
    assert (largest(measured).values[away] > 1e-8).all()


def test_gains_outweigh_losses_because_the_mean_of_the_inverse_is_one(measured):
    inverse = 1 / (1 + measured.energy_gain)
    np.testing.assert_allclose(inverse.mean("phase"), 1, rtol=0, atol=1e-3)
    mean = measured.energy_gain.mean("phase")
    assert (mean > -1e-11).all()
    assert float(mean.sel(omega_h=1.7, method="nearest")) > 0.5


@pytest.mark.parametrize("stiffness", [1e4, 1e6])
def test_with_gravity_a_magic_step_is_off_by_the_time_that_weight_adds(stiffness):
    """2gh/v, in the limit of a speed against which gravity does little during the contact."""
    scene = from_mapping({"ground": {"stiffness": stiffness}})
    found = bounce_map.measure(scene, omega_h=(0.3, 1.5), count=2, phases=50)
    speed = np.sqrt(25 + 2 * 9.8 * (3 - scene.cube.side / 2))
    assert float(found.speed) == pytest.approx(speed, rel=1e-12)
    np.testing.assert_allclose(
        found.gravity_theory, 2 * 9.8 * found.omega_h / np.sqrt(4 * stiffness) / speed, rtol=1e-12
    )
    at_magic = found.sel(omega_h=[2 * np.sin(np.pi / (2 * n)) for n in range(2, 11)])
    np.testing.assert_allclose(at_magic.energy_gain, 0, atol=1e-11)
    contact = 9.8 / (np.sqrt(4 * stiffness) * speed)
    np.testing.assert_allclose(at_magic.largest_with_gravity, at_magic.gravity_theory, rtol=12 * contact)


@pytest.mark.long
def test_without_gravity_there_is_one_answer():
    scene = from_mapping({"ground": {"stiffness": 1e5}, "gravity": 0, "launch": {"velocity": [0, 0, -4]}})
    found = bounce_map.measure(scene, omega_h=(0.1, 1.98), count=20, phases=30)
    assert float(found.speed) == 4
    np.testing.assert_array_equal(found.largest_with_gravity, np.abs(found.energy_gain).max("phase"))
    np.testing.assert_array_equal(found.gravity_theory, 0)


@pytest.mark.long
def test_the_map_is_the_same_for_any_cube_and_ground(measured):
    """Nor does it matter what the scene says of all that the experiment sets."""
    other = {
        "cube": {"radius": 0.2, "mass": 3.0, "geometry": "exact"},
        "ground": {"stiffness": 3e4, "normal": [1, 0, 2], "damping": 5.0, "friction": 1.0, "contact": "ungated"},
        "launch": {"velocity": [1, 2, 0], "orientation": [0.3, 0.2, 0.1], "angular_momentum": [1, 1, 1]},
    }
    found = bounce_map.measure(from_mapping(other), omega_h=(0.1, 1.9), count=2, phases=10).energy_gain[1:-1]
    there = measured.energy_gain.sel(omega_h=found.omega_h).sel(phase=found.phase, method="nearest")
    np.testing.assert_allclose(found, there, rtol=0, atol=1e-10)
    assert len(found) > 50


def test_everything_is_named_has_units_and_survives_a_file(measured, tmp_path):
    for name, variable in measured.variables.items():
        assert variable.attrs["units"], name
        assert variable.attrs["long_name"], name
    assert measured.attrs["model"] == "sliding"
    assert len(measured.attrs["code_digest"]) == 64
    write_dataset(measured, tmp_path / "bounces.h5")
    with xr.open_dataset(tmp_path / "bounces.h5", engine="h5netcdf") as stored:
        xr.testing.assert_equal(stored.load(), measured)


@pytest.mark.parametrize(
    ("scene", "arguments", "told"),
    [
        ({}, {"omega_h": (0.1, 2.0)}, r"omega_h = .*0.01 <= low < high < 2 \[1\]"),
        ({}, {"omega_h": (0.001, 1.0)}, "omega_h = "),
        ({}, {"omega_h": (1.0, 0.5)}, "omega_h = "),
        ({}, {"omega_h": (0.1, 0.2, 0.3)}, "omega_h = "),
        ({}, {"count": 1}, "count = 1"),
        ({}, {"phases": 0}, "phases = 0"),
        ({"ground": {"stiffness": 0}}, {}, "launch: .*ω = 0 rad/s; allowed is a launch above it and a depth"),
        (
            {"ground": {"stiffness": 50}},
            {},
            "launch: .*allowed is a launch above it and a depth v/ω of 0.000104 to 0.518",
        ),
        ({"ground": {"stiffness": 1e12}}, {}, "launch: "),
        (
            {"ground": {"stiffness": 300}, "launch": {"position": [0, 0, 0.6], "velocity": [0, 0, 0]}},
            {},
            "gravity = 9.8",
        ),
    ],
)
def test_what_cannot_be_measured_is_said(scene, arguments, told):
    with pytest.raises(InputError, match=told):
        bounce_map.measure(from_mapping(scene), **arguments)


@pytest.mark.parametrize(
    ("scene", "shortest"),
    [
        ({"ground": {"stiffness": 110}}, 0.1),
        ({"ground": {"stiffness": 1e6}, "launch": {"position": [0, 0, 0.5177], "velocity": [0, 0, -0.3]}}, 0.1),
        ({"ground": {"stiffness": 1e4}, "gravity": 150, "launch": {"position": [0, 0, 1], "velocity": [0, 0, 0]}}, 0.1),
        (
            {
                "ground": {"stiffness": 1e6},
                "gravity": 399,
                "launch": {"position": [0, 0, 0.5228], "velocity": [0, 0, 0]},
            },
            0.02,
        ),
    ],
)
@pytest.mark.long
def test_all_that_is_allowed_is_measured(scene, shortest):
    """Near the ends of what is allowed: deep, shallow, heavy, and both."""
    found = bounce_map.measure(from_mapping(scene), omega_h=(shortest, 1.999), count=20, phases=50)
    np.testing.assert_allclose(largest(found), by_theory(found), rtol=0, atol=1e-10)
    assert (found.largest_with_gravity < 1 + 1.2 * largest(found).max()).all()
