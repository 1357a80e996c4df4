from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError
from stiffdice.experiments import rocking
from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.writer import write_dataset
from stiffdice.scene.scene import Launch, Scene, from_mapping
from stiffdice.simulation.run import simulate

ZETA = (0.0, 0.1, 0.5, 1.0)
SMALL = {"cube": {"radius": 0.2, "mass": 3.0, "geometry": "exact"}, "ground": {"stiffness": 3e5, "normal": [1, 0, 2]}}
SCENES = {"paper": Scene(), "small, heavy, exact": from_mapping(SMALL)}


@pytest.fixture(scope="module", params=SCENES)
def measured(request):
    return rocking.measure(SCENES[request.param], zeta=ZETA)


@pytest.mark.long
def test_every_mode_goes_unstable_at_the_limit_of_theory(measured):
    assert measured.limit.dims == ("inertia", "mode", "zeta")
    theoretical = 2 * (np.sqrt(1 + np.square(ZETA)) - ZETA)
    np.testing.assert_allclose(measured.limit, np.broadcast_to(theoretical, measured.limit.shape), rtol=1e-6)


@pytest.mark.long
def test_the_step_shows_the_modes_of_theory(measured):
    assert meanings_of(measured.inertia) == ["solid", "corners"]
    assert meanings_of(measured.mode) == ["face_bounce", "face_rocking", "edge", "corner"]
    np.testing.assert_allclose(measured.mode_number, [[4, 6, 5, 4], [4, 2, 3, 2]], rtol=1e-6)
    np.testing.assert_allclose(measured.mode_number_theory, [[4, 6, 5, 4], [4, 2, 3, 2]], rtol=1e-12)


def test_rocking_limits_a_solid_cube_and_the_bounce_one_with_its_mass_at_the_corners(measured):
    steps = measured.longest_step.isel(zeta=0).values
    np.testing.assert_allclose(steps.min(axis=1), [2 / np.sqrt(6), 1], rtol=1e-6)
    assert list(steps.argmin(axis=1)) == [1, 0]


def test_a_nudge_is_neutral_below_the_limit_and_grows_above_as_theory_says(measured):
    relative = measured.omega_h_relative.values
    below, above = relative < 0.9999, relative > 1.0001
    assert below.sum() == above.sum() == 20
    undamped, damped = (measured.growth.sel(nudge_zeta=value).values for value in (0.0, 0.2))
    np.testing.assert_allclose(undamped[..., below], 1, rtol=0, atol=1e-6)
    assert undamped[..., above].min() > 1.2
    assert damped[..., below].max() < 0.96
    assert damped[..., above].min() > 1.04
    for growth, zeta in ((undamped, 0.0), (damped, 0.2)):
        limit = linear_theory.stability_limit(zeta)
        for away in (below, above):
            wanted = [linear_theory.growth(part * limit, zeta) for part in relative[away]]
            np.testing.assert_allclose(growth[..., away], np.broadcast_to(wanted, growth[..., away].shape), rtol=2e-5)


def test_growth_is_what_one_step_does_to_a_run_above_the_limit():
    """Seen in a run of the model that does not turn: each step multiplies the displacement by −growth."""
    scene = Scene().with_ground(friction=0, damping=0, contact="gated")
    h = 1.05 * 2 / linear_theory.contact_frequency(scene.ground.stiffness, scene.cube.mass)
    rest = scene.cube.side / 2 - scene.gravity / (4 * scene.ground.stiffness)
    launch = Launch(position=(0, 0, rest + 1e-10), velocity=(0, 0, 0))
    run = simulate(dataclasses.replace(scene, launch=launch, duration=20 * h), model="sliding", steps=20, every=1)
    moved = run.trajectory.state["position"][:, 2] - rest
    found = rocking.measure(scene, zeta=[0], nudge_zeta=[0], omega_h_relative=[1.05]).growth
    np.testing.assert_allclose(-moved[13:16] / moved[12:15], found.values.ravel()[0], rtol=1e-5)


def test_everything_is_named_has_units_and_survives_a_file(measured, tmp_path):
    for name, variable in measured.variables.items():
        assert variable.attrs["units"], name
        assert variable.attrs["long_name"], name
    for name in ("inertia", "mode", "nudge"):
        assert measured[name].dtype == np.int8
    assert measured.attrs["model"] == "tumbling"
    assert len(measured.attrs["code_digest"]) == 64
    write_dataset(measured, tmp_path / "rocking.h5")
    with xr.open_dataset(tmp_path / "rocking.h5", engine="h5netcdf") as stored:
        xr.testing.assert_equal(stored.load(), measured)


@pytest.mark.parametrize(
    ("scene", "arguments", "told"),
    [
        ({}, {"zeta": [0.5, 1.01]}, "zeta = .*allowed are numbers from 0 to 1"),
        ({}, {"zeta": []}, "zeta = "),
        ({}, {"nudge_zeta": [-0.1]}, "nudge_zeta = .*from 0 to 1"),
        ({}, {"omega_h_relative": [1.0, 1.3]}, "omega_h_relative = .*from 0.5 to 1.15"),
        ({}, {"steps": 5}, "steps = 5"),
        ({"gravity": 0}, {}, "gravity = 0: a cube at rest"),
        ({"ground": {"stiffness": 0}}, {}, "ground.stiffness = 0, "),
        ({"ground": {"stiffness": 10}}, {}, "ground.stiffness = 10, "),
    ],
)
def test_what_cannot_be_measured_is_said(scene, arguments, told):
    with pytest.raises(InputError, match=told):
        rocking.measure(from_mapping(scene), **({"zeta": [0.0]} | arguments))
