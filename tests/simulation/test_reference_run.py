from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.state import start_of
from stiffdice.errors import InputError
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.criteria.trajectory import SAMPLES
from stiffdice.simulation.reference_run import references

HALF = 1.0352761804100830 / 2  # of the side


def made(horizon, model="sliding", **keys):
    scene = from_mapping(keys)
    return references(scene, model, start_of(scene, model), horizon)


@pytest.mark.parametrize("velocity", [[5, 0, 5], [0, 0, 0], [1, 2, -3]])
def test_a_flight_is_the_parabola_itself(velocity):
    launch = {"position": [0, 0, 9], "velocity": velocity}
    found, error = made(0.8, ground={"contact": "gated"}, launch=launch)
    t = np.linspace(0, 0.8, SAMPLES + 1)[:, None]
    path = [0, 0, 9] + t * velocity - t**2 / 2 * [0, 0, 9.8]
    np.testing.assert_allclose(found["position"][0], path, rtol=0, atol=1e-11)
    assert error < 1e-11
    assert found["spacing"][0] * SAMPLES == found["horizon"][0] == 0.8


def test_a_bounce_is_the_damped_oscillators():
    """Down to the ground, an eighth of a swing into it, as the formula says."""
    stiffness, damping, speed = 400.0, 2.0, 3.0
    ground = {"contact": "gated", "friction": 0, "stiffness": stiffness, "damping": damping}
    launch = {"position": [0, 0, HALF], "velocity": [0, 0, -speed]}
    horizon = np.pi / 4 / np.sqrt(4 * stiffness)
    found, error = made(horizon, ground=ground, launch=launch, gravity=0)
    beta = 4 * damping / 2
    omega = np.sqrt(4 * stiffness - beta**2)
    t = np.linspace(0, horizon, SAMPLES + 1)
    exact = HALF - speed / omega * np.exp(-beta * t) * np.sin(omega * t)
    off = np.abs(found["position"][0, :, 2] - exact).max()
    assert off < 1e-11
    assert error < 1e-11


@pytest.mark.parametrize("stiffness", [1e2, 1e4, 1e6])
def test_it_is_small_whatever_the_stiffness(stiffness):
    """Over the first bounce, as part of a radius."""
    assert made(1.8, ground={"contact": "gated", "stiffness": stiffness})[1] < 1e-7


def test_each_launch_has_its_own():
    scene = from_mapping({"ground": {"contact": "gated"}})
    launches = np.repeat(start_of(scene, "sliding"), 3)
    launches["position"][:, 0] = [0, 1, 2]
    found, _ = references(scene, "sliding", launches, 1.0)
    np.testing.assert_allclose(found["position"][:, 0, 0], [0, 1, 2])
    np.testing.assert_allclose(found["position"][:, -1, 0], [5, 6, 7], rtol=1e-12)


def test_the_launches_are_left_as_they_are():
    scene = from_mapping({})
    launches = start_of(scene, "sliding")
    before = launches.copy()
    references(scene, "sliding", launches, 1.0)
    np.testing.assert_array_equal(launches, before)


@pytest.mark.parametrize("gravity", [1e308, 1e306, 1e200])
def test_a_reference_that_is_no_number_is_refused(gravity):
    with pytest.raises(InputError, match="trajectory: its reference ended early, left the numeric range"):
        made(1.0, gravity=gravity, launch={"velocity": [0, 0, -gravity]})
