from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError
from stiffdice.experiments.work_precision.measure import Effort, lag_time, path_of
from stiffdice.experiments.work_precision.problems import MEASURES, PROBLEMS, SAMPLES, Judge, scene_of, touchdown
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.engines import stepper
from stiffdice.simulation.run import simulate

BASE = from_mapping(
    {
        "ground": {"damping": 0.1, "friction": 0.1},
        "launch": {"angular_momentum": [0.3, 0.5, 0.2]},
        "duration": 3.0,
    },
    "as_written",
)


def reference_of(problem, scene):
    return stepper.ready("scipy_lsoda", scene, problem.model, SAMPLES, SAMPLES, 1e-11)()().states


@pytest.fixture(scope="module", params=PROBLEMS)
def judged(request):
    problem = PROBLEMS[request.param]
    scene = scene_of(problem, BASE, 1e4)
    states = reference_of(problem, scene)
    return problem, scene, states, Judge(problem, scene, states)


def test_scenes_are_what_they_are_called():
    scenes = {name: scene_of(problem, BASE, 1e6) for name, problem in PROBLEMS.items()}
    assert all(scene.ground.contact == "gated" and scene.ground.stiffness == 1e6 for scene in scenes.values())
    assert [scene.ground.friction for scene in scenes.values()] == [0.0, 0.1, 0.1]
    assert [any(scene.launch.spin) for scene in scenes.values()] == [False, False, True]
    assert all(scene.launch.position == BASE.launch.position for scene in scenes.values())


def test_the_reference_is_right_by_its_own_measure(judged):
    *_, states, judge = judged
    errors = judge.errors(states)
    assert list(errors) == list(MEASURES)
    assert errors["position"] == errors["energy"] == 0
    assert errors["restitution"] < 1e-8  # flat: against the exact one, not against the reference


def test_a_path_beside_the_reference_is_off_by_its_distance(judged):
    _, scene, states, judge = judged
    moved = states.copy()
    moved["position"][:, 1] += 0.25
    errors = judge.errors(moved)
    assert errors["position"] == pytest.approx(0.25 / scene.cube.radius)
    assert errors["energy"] == 0


def test_speed_lost_in_the_landing_is_an_error_of_restitution_and_energy(judged):
    """At the height of the first touch a cube that comes back at 0.9 of its speed there has 0.9 of e."""
    _, scene, states, judge = judged
    down, up = judge._speeds(states, 0.0)
    height = touchdown(scene)
    slower = states.copy()
    later = slice(judge._after, None)
    fall = 2 * scene.gravity * (states["position"][later, 2] - height)
    square = 0.81 * (states["velocity"][later, 2] ** 2 + fall) - fall
    slower["velocity"][later, 2] = np.sqrt(np.maximum(square, 0))
    assert judge.errors(slower)["restitution"] == pytest.approx(0.1 * up / down, rel=1e-6)
    stopped = states.copy()
    stopped["velocity"][-1] = stopped["angular_momentum"][-1] = 0
    start = (
        scene.cube.mass * 25
        + scene.gravity * 3
        + np.sum(np.square(scene.launch.spin)) / (2 * scene.cube.moment_of_inertia)
    )
    kinetic = np.sum(np.square(states["velocity"][-1])) / 2 + np.sum(np.square(states["angular_momentum"][-1])) / (
        2 * scene.cube.moment_of_inertia
    )
    assert judge.errors(stopped)["energy"] == pytest.approx(kinetic / start)


def test_a_scheme_whose_velocity_lags_is_judged_by_its_path():
    """As the criterion `restitution` does, between the steps at the ground."""
    flat = PROBLEMS["flat-bounce"]
    scene = scene_of(flat, BASE, 1e4)
    judge = Judge(flat, scene, reference_of(flat, scene))
    steps = SAMPLES * round(linear_theory.steps_for(scene, 0.4) / SAMPLES)
    effort = Effort(steps, np.nan)
    path = path_of(flat, scene, "symplectic_euler", effort, 10**6)
    found = judge.errors(path.states, lag_time(scene, "symplectic_euler", effort))["restitution"]
    wanted = simulate(scene, model="sliding", steps=steps).measures["restitution_error"][0]
    assert wanted > 1e-4
    assert found == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("problem", PROBLEMS)
def test_at_touchdown_the_lowest_node_is_on_the_ground(problem):
    scene = scene_of(PROBLEMS[problem], BASE, 1e4)
    height = touchdown(scene)
    u, g = scene.launch.velocity[2], scene.gravity
    time = (u + np.sqrt(u**2 + 2 * g * (scene.launch.position[2] - height))) / g
    turned = Rotation.from_rotvec(np.array(scene.launch.spin) / scene.cube.moment_of_inertia * time)
    assert height + turned.apply(scene.cube.node_offsets())[:, 2].min() == pytest.approx(0, abs=1e-12)


def test_what_left_the_range_is_not_a_number(judged):
    *_, states, judge = judged
    for value in (np.nan, np.inf, 1e300):
        broken = states.copy()
        for name in ("position", "velocity"):
            broken[name][3:] = value
        assert np.isnan(list(judge.errors(broken).values())).all()


@pytest.mark.parametrize(
    ("changes", "stiffness", "told"),
    [
        ({"gravity": 0.0}, 1e4, "from above the ground"),
        ({"duration": 0.5}, 1e4, r"duration = 0\.5: allowed is one in which the cube lands"),
        ({}, 1.0, "ground.stiffness = 1: the cube does not leave the ground in time"),
    ],
)
def test_what_cannot_be_judged_is_said(changes, stiffness, told):
    flat = PROBLEMS["flat-bounce"]
    with pytest.raises(InputError, match=told):
        scene = scene_of(flat, dataclasses.replace(BASE, **changes), stiffness)
        Judge(flat, scene, reference_of(flat, scene))
