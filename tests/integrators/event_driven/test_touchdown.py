"""The first touch-down of a free flight, against a look at every moment of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import physics_of, start_of
from stiffdice.integrators.event_driven.touchdown import free_time
from stiffdice.scene.rotation import rotated
from stiffdice.scene.scene import from_mapping

RANDOM = np.random.default_rng(4)


@njit(cache=True)
def found(model, physics, launch, most):
    return free_time(model, physics, launch[0], most)[0]


def flying(spin=(0.0, 0.0, 0.0), position=(0, 0, 3), velocity=(5, 0, 5), gravity=9.8, **launch):
    launch |= {"position": list(position), "velocity": list(velocity), "angular_momentum": list(spin)}
    return from_mapping(
        {
            "cube": {"geometry": "exact"},
            "ground": {"contact": "gated", "normal": launch.pop("normal", [0, 0, 1])},
            "launch": launch,
            "gravity": gravity,
        }
    )


def clearance(scene, model, times):
    """The lowest node's height above the ground at each time [m]."""
    start = start_of(scene, model)[0]
    spin = np.array(start["angular_momentum"]) / scene.cube.moment_of_inertia
    times = np.atleast_1d(times)
    centre = start["position"] + np.outer(times, start["velocity"])
    centre[:, 2] -= scene.gravity * times**2 / 2
    normal = np.array(scene.ground.normal)
    levels = [(rotated(start["node_offset"], spin * time) @ normal).min() for time in times]
    return centre @ normal + levels


def scenes(count):
    for _ in range(count):
        normal = RANDOM.normal(size=3) * [0.2, 0.2, 0] + [0, 0, 1]
        yield flying(
            spin=RANDOM.normal(size=3) * 10 ** RANDOM.uniform(-3, 1.5),
            position=(0, 0, RANDOM.uniform(1.5, 4)),
            velocity=RANDOM.normal(size=3) * 3,
            orientation=list(RANDOM.normal(size=3)),
            normal=[float(part) for part in normal / np.linalg.norm(normal)],
        )


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
@pytest.mark.long
def test_touches_down_when_the_lowest_node_first_reaches_the_ground(model):
    for scene in scenes(15):
        time = found(MODELS[model], physics_of(scene), start_of(scene, model), 1e9)
        before = np.linspace(0, time, 4000)[:-1]
        assert clearance(scene, model, before).min() > 0
        assert abs(clearance(scene, model, time)[0]) < 3e-14
        assert clearance(scene, model, time + 1e-6)[0] < 0


@pytest.mark.long
def test_finds_a_corner_that_dips_in_for_a_moment_only():
    """A spinning cube passes so low that a corner is below the ground for about a millisecond."""
    reach = math.sqrt(3) * from_mapping({"cube": {"geometry": "exact"}}).cube.side / 2
    scene = flying(spin=(2.0, 0.0, 0.0), position=(0, 0, 3), velocity=(0, 0, 0), gravity=0.0, orientation=[0.3, 0.2, 0])
    times = np.linspace(0, 3, 30_001)
    lowest = clearance(scene, "tumbling", times).min()
    lower = flying(
        spin=(2.0, 0.0, 0.0),
        position=(0, 0, 3 - lowest - 1e-6),
        velocity=(0, 0, 0),
        gravity=0.0,
        orientation=[0.3, 0.2, 0],
    )
    assert 3 - lowest > reach / 2
    time = found(MODELS["tumbling"], physics_of(lower), start_of(lower, "tumbling"), 3.0)
    assert time < 3.0
    assert abs(clearance(lower, "tumbling", time)[0]) < 3e-14
    higher = flying(
        spin=(2.0, 0.0, 0.0),
        position=(0, 0, 3 - lowest + 1e-6),
        velocity=(0, 0, 0),
        gravity=0.0,
        orientation=[0.3, 0.2, 0],
    )
    assert found(MODELS["tumbling"], physics_of(higher), start_of(higher, "tumbling"), 3.0) == 3.0


def test_a_body_with_a_node_below_the_ground_has_no_flight():
    scene = flying(position=(0, 0, 0.5))
    assert found(MODELS["tumbling"], physics_of(scene), start_of(scene, "tumbling"), 1.0) == 0.0


def test_a_body_that_leaves_the_ground_flies():
    scene = flying(position=(0, 0, 1 / math.sqrt(3)), velocity=(0, 0, 4.9))
    time = found(MODELS["sliding"], physics_of(scene), start_of(scene, "sliding"), 5.0)
    assert time == pytest.approx(1.0, abs=1e-15)


def test_a_body_that_never_lands_flies_on():
    scene = flying(velocity=(1, 2, 0), gravity=0.0, spin=(3, 2, 1))
    assert found(MODELS["tumbling"], physics_of(scene), start_of(scene, "tumbling"), 1e3) == 1e3


@pytest.mark.parametrize("normal", [(0, 0, 1), (0.6, 0, 0.8)])
def test_a_cube_that_a_contact_let_go_flies_though_round_off_has_it_below(normal):
    """Else neither flight nor contact would move it: at S = 2.6e8 kg/s² one was let go 1.8e-15 m below."""
    ulps = 7 * 2.0**-52
    for below in (0.0, 0.5, 1.0):
        scene = flying(position=(0, 0, 3), velocity=7.2 * np.array(normal), normal=list(normal))
        start = start_of(scene, "sliding")
        lowest = float((start["node_offset"][0] @ np.array(scene.ground.normal)).min())
        start["position"][0] = -lowest * np.array(scene.ground.normal)
        start["position"][0] -= below * ulps * (1.0 - lowest) * np.array(scene.ground.normal)
        assert found(MODELS["sliding"], physics_of(scene), start, 0.01) == 0.01
