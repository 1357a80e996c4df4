from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from stiffdice.dynamics.model_selection import least_model
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import physics_of, start_of
from stiffdice.errors import InputError
from stiffdice.experiments import model_ablation
from stiffdice.experiments.model_ablation import pieces_of, take_with_tensor
from stiffdice.io.cf_enums import meanings_of
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation.engines import stepper

pytestmark = pytest.mark.long

STIFFNESS, FRICTION = (1e3, 1e5), (0.0, 0.01, 0.075)


@pytest.fixture(scope="module")
def measured():
    return model_ablation.measure(Scene(), stiffness=STIFFNESS, friction=FRICTION, horizon=3.3)


def test_without_friction_ground_cube_is_exact(measured):
    exact = measured.sel(friction=0.0)
    assert np.nanmax(np.abs(exact.landing_error)) < 1e-9
    assert np.isnan(exact.parting_time).all()
    assert np.abs(exact.spin).max() < 1e-9


def test_with_friction_it_is_not(measured):
    """The paper's own ground, S = 1e3 to 1e5, D = 0.2, mu = 0.075."""
    rough = measured.sel(friction=0.075)
    error, parting = rough.landing_error.values, rough.parting_time.values
    assert (error[0] > 0.01).all()
    assert (parting < rough.second_landing.values).all()
    assert (np.degrees(rough.tilt.values) > 20).all()
    assert meanings_of(measured.approximation) == ["sliding", "frictionless"]
    assert (error[1] > 10 * error[0]).all()
    assert (rough.numerical_error < 0.01).all()


@pytest.mark.parametrize(("inertia", "sense"), [("solid", -1), ("corners", 1)])
def test_little_friction_leaves_the_spin_of_theory(inertia, sense):
    """A solid cube rolls backwards: the springs swing it back within the bounce."""
    scene = from_mapping({"cube": {"inertia": inertia}})
    spin = model_ablation.measure(scene, stiffness=(1e5,), friction=(0.01,), horizon=2.2)
    np.testing.assert_allclose(spin.spin, spin.spin_theory, rtol=0.03)
    assert (np.sign(spin.spin) == sense).all()


def test_the_spin_of_theory_is_the_spin_of_its_equation():
    scene = from_mapping({"cube": {"inertia": "corners"}, "ground": {"stiffness": 100, "friction": 0.1}})
    cube, speed, steps = scene.cube, 2.0, 200_000
    omega, arm = np.sqrt(4 * 100 / cube.mass), cube.side / 2
    h, angle, rate = np.pi / omega / steps, 0.0, 0.0
    for k in range(steps):
        push = cube.mass * omega * speed * np.sin(omega * (k + 0.5) * h)
        rate += h * (0.1 * push * arm - 100 * cube.side**2 * angle) / cube.moment_of_inertia
        angle += h * rate
    assert model_ablation.first_spin(scene, speed) == pytest.approx(rate, rel=1e-4)


@pytest.mark.parametrize(
    ("changes", "options", "told"),
    [
        ({"velocity": (0.0, 0.0, 5.0)}, {}, "launch: allowed is an upright cube without spin"),
        ({"angular_momentum": (0.0, 0.0, 1.0)}, {}, "launch: allowed"),
        ({}, {"friction": [-1]}, "friction = -1"),
        ({}, {"stiffness": [0]}, "stiffness = 0"),
        ({}, {"tolerance": 0}, "tolerance = 0"),
    ],
)
def test_what_cannot_be_measured_is_said(changes, options, told):
    scene = Scene(launch=dataclasses.replace(Scene().launch, **changes))
    with pytest.raises(InputError, match=told):
        model_ablation.measure(scene, **options)


@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_each_scene_needs_all_but_its_piece(contact):
    found = pieces_of(Scene().with_ground(contact=contact))
    for name, (scene, _, least) in found.items():
        assert least_model(scene)[0] == least, name
    assert (found["tensor"][1], found["all"][1]) == ("tensor", "tumbling")


@pytest.mark.long
def test_a_tensor_that_turns_with_a_cube_changes_nothing():
    scene = from_mapping({"launch": {"angular_momentum": [0.3, 0.5, -0.2]}, "duration": 1.8})
    model, steps = MODELS["tumbling"], 3000
    plain = stepper.ready("symplectic_euler", scene, "tumbling", steps, 1)()().states[1:]
    turning, tensor = start_of(scene, "tumbling"), scene.cube.moment_of_inertia * np.eye(3)
    take_with_tensor(model, physics_of(scene), turning, tensor, scene.duration / steps, steps)
    for part in ("position", "velocity", "angular_momentum", "angular_velocity", "node_offset"):
        np.testing.assert_allclose(turning[part], plain[part], rtol=0, atol=1e-9, err_msg=part)
    assert np.abs(plain["node_offset"] - start_of(scene, "tumbling")["node_offset"]).max() > 0.5
    np.testing.assert_allclose(tensor, scene.cube.moment_of_inertia * np.eye(3), rtol=0, atol=1e-13)


@pytest.mark.long
def test_a_tensor_that_is_not_isotropic_turns_with_its_body():
    """A freely turning body keeps its angular momentum and, to the step's first order, its energy L·ω/2."""
    scene = from_mapping({"ground": {"contact": "gated"}, "launch": {"position": [0, 0, 99]}, "gravity": 0})
    state, tensor = start_of(scene, "tumbling"), scene.cube.moment_of_inertia * np.eye(3)
    tensor[:] = np.diag([0.1, 0.2, 0.3])
    state["angular_momentum"] = spin = np.array([0.3, 0.1, 0.2])
    before = spin @ np.linalg.solve(tensor, spin) / 2
    take_with_tensor(MODELS["tumbling"], physics_of(scene), state, tensor, 1e-4, 20_000)
    np.testing.assert_allclose(np.linalg.eigvalsh(tensor), [0.1, 0.2, 0.3], rtol=1e-9)
    assert np.abs(tensor - np.diag([0.1, 0.2, 0.3])).max() > 0.02
    assert spin @ np.linalg.solve(tensor, spin) / 2 == pytest.approx(before, rel=1e-3)


@pytest.mark.long
def test_times_are_told_apart_from_what_rebuilds_share():
    timed = model_ablation.time(Scene().with_ground(contact="gated"), steps=500, rounds=3)
    assert timed.step_time.dims == ("piece", "role")
    assert (timed.step_time > 0).all()
    bare = meanings_of(timed.piece).index("tensor")
    assert np.flatnonzero(np.isnan(timed.run_ratio)).tolist() == [bare]
    assert (timed.step_ratio > 0).all()
