from __future__ import annotations

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments import friction_chatter
from stiffdice.scene.scene import Scene, from_mapping

SIZES = (1e-7, 1e-6, 2.5e-6, 3e-6, 1e-5, 1e-4, 1e-3)


@pytest.fixture(scope="module")
def measured():
    return friction_chatter.measure(Scene(), friction=(0.075, 1.0), step_size=SIZES)


def test_the_swing_is_that_of_theory(measured):
    swing = 0.075 * 9.8 * np.array(SIZES) / 2 - 1e-6
    np.testing.assert_allclose(measured.swing_theory[0], np.maximum(swing, 0))
    chatters = measured.swing_theory.values > 0
    np.testing.assert_allclose(measured.swing.values[chatters], measured.swing_theory.values[chatters], rtol=1e-4)
    assert measured.swing.values[~chatters].max() < 1e-12


def test_it_comes_to_rest_at_short_steps_only(measured):
    np.testing.assert_allclose(measured.least_step, [2e-6 / (0.075 * 9.8), 2e-6 / 9.8])
    for k, least in enumerate(measured.least_step.values):
        rests = measured.swing.values[k] < 1e-12
        np.testing.assert_array_equal(rests, np.array(SIZES) < least)


@pytest.mark.parametrize("changes", [{"ground": {"stiffness": 3e3, "damping": 4}}, {"cube": {"mass": 5.0}}], ids=str)
def test_neither_ground_nor_mass_matter(changes, measured):
    other = friction_chatter.measure(from_mapping(changes), friction=(0.075, 1.0), step_size=SIZES)
    np.testing.assert_allclose(other.swing, measured.swing, rtol=1e-3, atol=1e-12)


def test_the_cutoff_grows_with_the_cube():
    large = friction_chatter.measure(
        from_mapping({"cube": {"radius": 10.0}, "launch": {"position": [0, 0, 30]}}), friction=(1,)
    )
    np.testing.assert_allclose(large.least_step, 2e-5 / 9.8)


@pytest.mark.parametrize(
    ("scene", "options", "told"),
    [
        ({}, {"step_size": [0.1]}, "step_size = 0.1: allowed are numbers <= 0.0075"),
        ({}, {"friction": [0.0]}, "friction = 0"),
        ({"gravity": 0}, {}, "gravity = 0"),
        ({"ground": {"stiffness": 1}}, {}, "ground.stiffness = 1,"),
    ],
)
def test_what_cannot_be_measured_is_said(scene, options, told):
    with pytest.raises(InputError, match=told):
        friction_chatter.measure(from_mapping(scene), **options)
