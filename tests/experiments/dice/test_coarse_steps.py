"""Faces stand at steps at which paths are lost."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments.dice import coarse_steps
from stiffdice.integrators import linear_stability
from stiffdice.scene import die
from stiffdice.scene.scene import from_mapping

DIE = {**die.SCENE, "cube": {**die.SCENE["cube"], "load": {"at": "corner", "mass": "1 g"}}}
LOADED = from_mapping(DIE)
LOW = {"launch": {"position": [0, 0, 0.03], "velocity": [0.2, 0, 0], "node_velocity": "rigid"}, "duration": 0.5}


def test_steps_are_those_of_the_fastest_contact():
    steps = coarse_steps.steps_at(LOADED, 0.5)
    omega = linear_stability.hardest(LOADED, "tumbling").omega
    assert omega * LOADED.duration / steps == pytest.approx(0.5, rel=1e-3)
    assert omega > linear_stability.hardest(from_mapping(die.SCENE), "sliding").omega


@pytest.mark.long
def test_faces_stand_at_steps_near_the_limit():
    one_path = {"path_omega_h": [1.0], "path_schemes": ["rk4"], "paths": 1}
    found = coarse_steps.measure(LOADED, omega_h=[1.9, 1.0], finest=0.4, throws=2000, **one_path)
    far, near = found.total_variation.values
    assert near < found.sampling_95.values[1]
    assert far > 2 * found.sampling_95.values[0]


@pytest.mark.long
def test_paths_are_lost_at_such_steps():
    """Of a die that is dropped from so low that at short steps nothing is lost."""
    low, asked = from_mapping({**DIE, **LOW}), {"omega_h": [1.0], "finest": 0.9, "throws": 8}
    found = coarse_steps.measure(low, **asked, path_omega_h=[1.0, 0.02], path_schemes=["rk4"], paths=10)
    assert found.face_changed.values[0, 0] > 0 == found.face_changed.values[0, 1]
    assert found.path_error.values[0, 0] > 3 * found.path_error.values[0, 1]
    assert np.all(np.diff(found.evaluations.values) > 0)


@pytest.mark.broad
def test_faces_stand_at_steps_at_which_paths_are_lost():
    """At ωh = 1 the distribution is that of steps a fifth as long, but for sampling; most paths end on another face."""
    found = coarse_steps.measure(
        LOADED, omega_h=[1.9, 1.0], finest=0.2, throws=40_000, path_omega_h=[1.0, 0.02], path_schemes=["rk4"], paths=60
    )
    far, near = found.total_variation.values
    assert near < found.sampling_95.values[1]
    assert far > 2 * found.sampling_95.values[0]
    assert found.face_changed.values[0, 0] > 0.5 > found.face_changed.values[0, 1]
    assert found.path_error.values[0, 0] > 3 * found.path_error.values[0, 1]
    assert np.all(np.diff(found.evaluations.values) > 0)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"finest": 0.4}, "finest = 0.4: allowed is a number below"),
        ({"omega_h": [0.0]}, "omega_h = 0"),
        ({"path_schemes": ["exact"]}, "path_schemes = exact"),
        ({"paths": 0}, "paths = 0"),
    ],
)
def test_options_out_of_range_are_told(options, told):
    with pytest.raises(InputError, match=told):
        coarse_steps.measure(LOADED, **options)
