from __future__ import annotations

import math

import numpy as np
import pytest

from stiffdice.dynamics.flat_bounce import restitution
from stiffdice.dynamics.linear_theory import sag
from stiffdice.dynamics.state import STATE, start_of
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate

pytest.importorskip("mujoco")
from stiffdice.simulation.engines import mujoco

pytestmark = pytest.mark.long

TUMBLE = {"angular_momentum": [0.3, 0.5, 0.2], "orientation": [0.1, 0.2, 0.3], "node_velocity": "rigid"}

# Rotation vectors that bring a face, an edge or a corner of the cube down.
FLAT, EDGE = [0.0, 0.0, 0.0], [math.pi / 4, 0.0, 0.0]
CORNER = (math.acos(1 / math.sqrt(3)) * np.array([1, -1, 0]) / math.sqrt(2)).tolist()


def scene_of(ground, launch=(), duration=1.0):
    ground = {"contact": "gated", "friction": 0.0, "damping": 0.0, **ground}
    return from_mapping({"ground": ground, "launch": dict(launch), "duration": duration})


def run(scene, model, steps, every=1):
    engine = mujoco.Mujoco(scene, model, start_of(scene, model), scene.duration / steps, 1e-9)
    states = np.zeros(steps // every, STATE)
    assert engine.advance(states, every) == steps
    return states


@pytest.mark.parametrize(
    ("model", "ground", "tolerance"),
    [
        ("vertical", {"stiffness": 1e4, "damping": 0.5}, 1e-12),
        ("vertical", {"stiffness": 1e8, "damping": 0.0}, 1e-12),
        ("tumbling", {"stiffness": 1e4, "damping": 0.5, "normal": [0.1, 0.2, 1.0]}, 1e-8),
        ("tumbling", {"stiffness": 1e4, "damping": 0.5}, 1e-8),
    ],
)
def test_without_friction_it_is_our_symplectic_euler_step_by_step(model, ground, tolerance):
    """To round-off, which every bounce of a tumbling cube makes larger."""
    scene = scene_of(ground, TUMBLE, 3.0)
    steps = 30_000 if ground["stiffness"] < 1e8 else 300_000
    ours = simulate(scene, model=model, steps=steps, every=steps // 100).trajectory.state[1:]
    theirs = run(scene, model, steps, steps // 100)
    for name in STATE.names:
        np.testing.assert_allclose(theirs[name], ours[name], rtol=0, atol=tolerance * 100)
    np.testing.assert_allclose(theirs["position"], ours["position"], rtol=0, atol=tolerance)


@pytest.mark.parametrize(("orientation", "nodes"), [(CORNER, 1), (EDGE, 2), (FLAT, 4)])
@pytest.mark.parametrize("stiffness", [1e2, 1e8])
def test_each_node_is_a_spring_of_its_own(orientation, nodes, stiffness):
    """A cube that is put where k springs carry it stays there: m g/(kS) deep."""
    scene = scene_of({"stiffness": stiffness}, {"orientation": orientation, "velocity": [0, 0, 0]})
    launch = start_of(scene, "vertical")
    depth = scene.cube.mass * scene.gravity / (nodes * stiffness)
    launch["position"][:, 2] = -launch["node_offset"][..., 2].min() - depth
    states = np.zeros(200, STATE)
    mujoco.Mujoco(scene, "vertical", launch, 0.05 / math.sqrt(stiffness), 1e-9).advance(states, 10)
    assert np.abs(states["position"][:, 2] - launch["position"][0, 2]).max() < 1e-6 * depth + 1e-15


def test_a_cube_comes_to_rest_as_deep_as_its_weight_presses_it():
    scene = scene_of({"stiffness": 1e3, "damping": 10.0}, {"position": [0, 0, 0.52], "velocity": [0, 0, 0]}, 5.0)
    end = run(scene, "tumbling", 20_000, 20_000)[-1]
    assert scene.cube.side / 2 - end["position"][2] == pytest.approx(sag(scene), rel=1e-9)


@pytest.mark.parametrize("damping", [0.0, 20.0])
def test_a_bounce_is_the_exact_one_as_steps_become_short(damping):
    """Of first order in the step."""
    scene = scene_of({"stiffness": 1e4, "damping": damping}, {"position": [0, 0, 1], "velocity": [0, 0, -5]}, 0.2)
    fallen = math.sqrt(25 + 2 * scene.gravity * (1 - scene.cube.side / 2))
    errors = []
    for steps in (4_000, 64_000):
        end = run(scene, "vertical", steps, steps)[-1]
        left = end["velocity"][2] ** 2 + 2 * scene.gravity * (end["position"][2] - scene.cube.side / 2)
        errors.append(abs(math.sqrt(left) / fallen - restitution(scene, fallen)))
    assert errors[0] < 0.02
    assert errors[1] < errors[0] / 8


@pytest.mark.parametrize(("model", "damping"), [("sliding", 0.0), ("tumbling", 20.0)])
def test_friction_stops_a_sliding_cube_and_holds_it(model, damping):
    """It slides u²/(2 mu g), straight, and then stands still. Friction needs no dashpot; what rocks does."""
    scene = scene_of({"stiffness": 1e4, "friction": 0.3, "damping": damping}, {"velocity": [0.8, 0.6, 0]})
    launch = start_of(scene, model)
    launch["position"][:, 2] = scene.cube.side / 2 - sag(scene)
    states = np.zeros(1000, STATE)
    mujoco.Mujoco(scene, model, launch, 1e-4, 1e-9).advance(states, 10)
    far = states["position"][-1, :2]
    assert np.hypot(*far) == pytest.approx(1 / (2 * 0.3 * scene.gravity), rel=2e-3)
    assert far[1] / far[0] == pytest.approx(0.75, rel=2e-3)
    assert np.abs(states["velocity"][-1, :2]).max() < 1e-6


@pytest.mark.parametrize(("friction", "slides"), [(0.21, 0.0), (0.19, 0.01)])
def test_on_a_slope_a_cube_slides_only_beyond_the_coefficient(friction, slides):
    """Of one in five: it speeds up by g (sin − mu cos), or not at all, but for what creeps to a hold."""
    normal = np.array([-0.2, 0, 1]) / math.hypot(0.2, 1)
    scene = scene_of({"stiffness": 1e4, "friction": friction, "normal": normal.tolist()}, {"velocity": [0, 0, 0]})
    launch = start_of(scene, "sliding")
    lowest = (launch["node_offset"][0] @ normal).min()
    depth = scene.gravity * normal[2] / (2 * scene.ground.stiffness)  # the two lower ones carry it
    launch["position"] = normal * (-lowest - depth)
    states = np.zeros(100, STATE)
    mujoco.Mujoco(scene, "sliding", launch, 1e-4, 1e-9).advance(states, 100)
    speed = -states["velocity"][-1, 0] / normal[2]
    assert speed == pytest.approx(slides * scene.gravity * normal[2], abs=1e-4)


def test_friction_acts_half_way_up_to_the_surface():
    """What MuJoCo cannot do otherwise: the force is ours, its torque that of a place half the depth above the node."""
    scene = scene_of({"stiffness": 1e4, "friction": 0.1}, {"orientation": CORNER, "velocity": [1.0, 0.5, 0]})
    launch, depth, h = start_of(scene, "tumbling"), 0.02, 1e-7
    node = launch["node_offset"][0, launch["node_offset"][0, :, 2].argmin()]
    launch["position"][:, 2] = -node[2] - depth
    states = np.zeros(1, STATE)
    mujoco.Mujoco(scene, "tumbling", launch, h, 1e-9).advance(states, 1)
    push = 1e4 * depth
    force = np.array([-0.1 * push * 2 / math.sqrt(5), -0.1 * push / math.sqrt(5), push])
    felt = (states["velocity"] - launch["velocity"])[0] / h + [0, 0, scene.gravity]
    np.testing.assert_allclose(felt, force, rtol=1e-6)
    arm = node + np.array([0, 0, depth / 2])
    np.testing.assert_allclose(states["angular_momentum"][0] / h, np.cross(arm, force), rtol=1e-6, atol=1e-6)


def test_a_run_that_blows_up_ends_in_not_a_numbers_and_says_nothing(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    scene = scene_of({"stiffness": 1e8}, {"velocity": [0, 0, -1e305], **TUMBLE})
    states = run(scene, "tumbling", 200_000, 2000)
    assert np.isnan(states["position"][-1]).all()
    assert np.isnan(states["velocity"][-1]).all()
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())


def test_beyond_the_stability_limit_a_cube_is_thrown_up_and_the_run_goes_on():
    scene = scene_of({"stiffness": 1e6}, {"velocity": [0, 0, 0]}, 3.0)
    states = run(scene, "vertical", 1000)  # ωh = 6
    assert states["position"][:, 2].max() > 2 * states["position"][0, 2]


@pytest.mark.parametrize(
    ("ground", "launch", "named"),
    [
        ({"contact": "ungated", "damping": 0.2}, {}, "ground.contact"),
        ({}, {"angular_momentum": [1, 0, 0], "position": [0, 0, 0.1]}, "launch.node_velocity"),
        ({"contact": "ungated"}, {}, None),
        ({"damping": 0.2}, {"angular_momentum": [1, 0, 0]}, None),
    ],
)
def test_it_says_what_it_cannot_represent(ground, launch, named):
    scene = scene_of(ground, launch)
    why = mujoco.Mujoco.unfit(scene, "tumbling")
    assert (why is None) == (named is None)
    assert named is None or named in why
    assert mujoco.Mujoco.unfit(scene, "flying") is None
    assert why is None or "MuJoCo's " in why


def test_the_version_is_told():
    assert mujoco.Mujoco.version().startswith("mujoco ")
