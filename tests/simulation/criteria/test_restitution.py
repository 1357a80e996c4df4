"""Undamped and gated, each bounce gives back all: there the contact law, solved exactly, has e = 1."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.scene.rotation import rotated
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate

LOSSLESS = {"contact": "gated", "damping": 0, "friction": 0}
HALF = 1.0352761804100830 / 2  # of the side


def error(steps=10_000, model="sliding", **keys):
    return float(simulate(from_mapping(keys), model=model, steps=steps).measures["restitution_error"][0])


def test_without_gravity_it_is_what_the_bounce_gains_or_loses():
    """Against the speed of the trajectory before and after, which is constant in both flights."""
    for omega_h in (0.3, 0.9, 1.6, 1.9):
        h = omega_h / 200
        launch = {"position": [0, 0, HALF + 3 * h * 2.4], "velocity": [0, 0, -3]}
        scene = from_mapping({"ground": LOSSLESS, "launch": launch, "gravity": 0, "duration": 60 * h})
        run = simulate(scene, model="sliding", steps=60, every=1)
        out = run.trajectory.state["velocity"][-1, 2]
        assert out > 0
        assert run.measures["restitution_error"][0] == pytest.approx(abs(out / 3 - 1), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("n", [2, 3, 7])
def test_magic_steps_have_no_error(n):
    h = 2 * np.sin(np.pi / (2 * n)) / 200
    launch = {"position": [0, 0, HALF + 3 * h * 2.4], "velocity": [0, 0, -3]}
    assert error(60, ground=LOSSLESS, launch=launch, gravity=0, duration=60 * h) < 1e-11


def test_it_is_the_worst_of_all_bounces():
    """Speeds at touch-down level from the energies of the flights, which gravity leaves alone."""
    stiffness, steps = 1e6, 12_345
    scene = from_mapping({"ground": LOSSLESS | {"stiffness": stiffness}})
    run = simulate(scene, model="sliding", steps=steps, every=1)
    kept, h = run.trajectory, 10 / steps
    c = kept.state["position"][:, 2] - HALF
    air = (c[1:] > 0) & (c[:-1] > 0)
    # Between two places in the air the cube moves at their difference, and is g h²/8 above their middle.
    level = np.where(air, np.diff(c) ** 2 / h**2 + 2 * 9.8 * ((c[1:] + c[:-1]) / 2 + 9.8 * h * h / 8), np.nan)
    flights = [np.nanmean(part) for part in np.split(level, np.flatnonzero(~air)) if np.isfinite(part).any()]
    e = np.sqrt(np.array(flights[1:]) / flights[:-1])
    assert len(e) >= 4
    assert run.measures["restitution_error"][0] == pytest.approx(np.abs(e - 1).max(), rel=1e-7)


@pytest.mark.parametrize("steps", [2_000, 20_000, 200_000])
def test_it_falls_with_the_step_to_the_second_order(steps):
    """e² is within 1/(1 − (ωh)²/4) of 1, whatever the phase."""
    omega_h = np.sqrt(4e6) * 1.5 / steps
    bound = (1 - omega_h**2 / 4) ** -0.5 - 1
    drops = HALF + np.linspace(1, 1.01, 11)
    found = [
        error(steps, ground=LOSSLESS | {"stiffness": 1e6}, duration=1.5, launch={"position": [0, 0, z]}) for z in drops
    ]
    assert 0.2 * bound < max(found) < 1.05 * bound


def test_no_bounce_no_error():
    assert error(ground=LOSSLESS, duration=0.5) == 0


@pytest.mark.parametrize("turn", [[0.1, 0, 0], [0, 0.78, 0], [0.3, 0.2, 0.1]], ids=["edge", "steep edge", "corner"])
def test_a_cube_that_does_not_land_flat_has_none(turn):
    assert np.isnan(error(ground=LOSSLESS, launch={"orientation": turn}))


@pytest.mark.parametrize("turn", [[0, 0, 0.6], [np.pi / 2, 0, 0]], ids=["about the normal", "on another face"])
def test_what_matters_is_which_nodes_touch(turn):
    upright, turned = error(ground=LOSSLESS), error(ground=LOSSLESS, launch={"orientation": turn})
    assert turned == pytest.approx(upright, rel=1e-6)


def test_flat_is_along_the_slope():
    slope, turn = [0, np.sin(0.3), np.cos(0.3)], [-0.3, 0, 0]
    np.testing.assert_allclose(rotated(np.array([[0, 0, 1.0]]), np.array(turn))[0], slope, atol=1e-15)
    ground = LOSSLESS | {"normal": slope}
    assert np.isnan(error(ground=ground))
    assert error(ground=ground, launch={"orientation": turn}) < 0.2**2 / 8 * 1.05  # ωh = 0.2


def test_a_bounce_so_deep_that_the_other_nodes_touch_too_is_not_known():
    """On soft ground all eight nodes push: another frequency, another restitution."""
    thrown = {"velocity": [0, 0, -5]}
    run = simulate(from_mapping({"ground": LOSSLESS | {"stiffness": 10}, "launch": thrown}), model="sliding", steps=300)
    assert run.measures["apex_ratio"][0] > 0  # it did bounce
    assert np.isnan(run.measures["restitution_error"][0])


def test_a_cube_that_settles_does_not_count():
    """Dropped from less than ten times its sag at rest, coarsely."""
    for sags, counts in ((9, False), (11, True)):
        launch = {"position": [0, 0, HALF + sags * 9.8 / 4e3], "velocity": [0, 0, 0]}
        found = error(45, ground=LOSSLESS | {"stiffness": 1e3}, launch=launch, duration=0.5)
        assert (found > 0) == counts


@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_a_damped_bounce_comes_to_what_its_own_law_gives_back(contact):
    """Under either law, and far from what the other gives back."""
    keys = {"ground": {"contact": contact, "damping": 2.0, "friction": 0.3}, "launch": {"velocity": [2, 0, 0]}}
    coarse, fine = (error(steps, **keys) for steps in (20_000, 200_000))
    assert 0 < fine < coarse / 5
    assert coarse < 5e-3
