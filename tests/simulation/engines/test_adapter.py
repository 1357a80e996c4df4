"""What engines of rigid bodies have in common, each with the ground that it has."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.state import STATE, start_of
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.run import simulate

pytestmark = [pytest.mark.long, pytest.mark.parametrize("name", ["mujoco", "pybullet", "dart"])]

TUMBLE = {"angular_momentum": [0.3, 0.5, 0.2], "orientation": [0.1, 0.2, 0.3], "node_velocity": "rigid"}


def scene_of(ground, launch=(), duration=1.0):
    ground = {"contact": "gated", "friction": 0.0, "damping": 0.0, **ground}
    return from_mapping({"ground": ground, "launch": dict(launch), "duration": duration})


def engine_of(name):
    pytest.importorskip(f"stiffdice.simulation.engines.{name}")
    return engines.adapter_of(name)


def run(name, scene, model, steps, every=1):
    engine = engine_of(name)(scene, model, start_of(scene, model), scene.duration / steps, 1e-9)
    states = np.zeros(steps // every, STATE)
    assert engine.advance(states, every) == steps
    return states


@pytest.mark.parametrize("model", ["flying", "sliding"])
def test_the_path_of_a_free_flight_lags_as_it_is_said(name, model):
    """u + LAG·(u − u_before) is the parabola's slope; nothing changes the spin, and the cube stays rigid."""
    scene = scene_of({"stiffness": 1e4}, {"position": [0, 0, 50], **TUMBLE})
    h = scene.duration / 100
    states = run(name, scene, model, 100)
    place, speed = states["position"][:, 2], states["velocity"][:, 2]
    slope = (place[2:] - place[:-2]) / (2 * h)
    np.testing.assert_allclose(
        slope, (speed + engines.adapter_of(name).LAG * np.diff(speed, prepend=np.nan))[1:-1], atol=1e-10
    )
    turns = model == "flying"
    spin = [0.3, 0.5, 0.2] if turns else [0, 0, 0]
    np.testing.assert_allclose(states["angular_momentum"], np.tile(spin, (100, 1)), atol=1e-13)
    reference = simulate(scene, model="tumbling" if turns else model, steps=100, every=1).trajectory.state[1:]
    np.testing.assert_allclose(states["node_offset"], reference["node_offset"], atol=1e-12)


def test_how_often_states_are_asked_for_does_not_change_them(name):
    scene = scene_of({"stiffness": 1e4, "friction": 0.1}, TUMBLE, 1.0)
    every_one = run(name, scene, "tumbling", 4200)
    assert np.array_equal(run(name, scene, "tumbling", 4200, 7), every_one[6::7])
    assert np.array_equal(run(name, scene, "tumbling", 4200, 2100), every_one[2099::2100])
    engine = engine_of(name)(scene, "tumbling", start_of(scene, "tumbling"), scene.duration / 4200, 1e-9)
    first, second = np.zeros(3, STATE), np.zeros(2, STATE)
    engine.advance(first, 1000)
    engine.advance(second, 600)
    assert np.array_equal(first, every_one[[999, 1999, 2999]])
    assert np.array_equal(second, every_one[[3599, 4199]])
