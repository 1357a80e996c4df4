from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest

from stiffdice.dynamics.flat_bounce import restitution
from stiffdice.dynamics.linear_theory import sag
from stiffdice.dynamics.state import STATE, start_of
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate

pytest.importorskip("stiffdice.simulation.engines.pybullet")
from stiffdice.simulation.engines import pybullet

pytestmark = pytest.mark.long

TUMBLE = {"angular_momentum": [0.3, 0.5, 0.2], "orientation": [0.1, 0.2, 0.3], "node_velocity": "rigid"}

# Rotation vectors that bring a face, an edge or a corner of the cube down.
FLAT, EDGE = [0.0, 0.0, 0.0], [math.pi / 4, 0.0, 0.0]
CORNER = (math.acos(1 / math.sqrt(3)) * np.array([1, -1, 0]) / math.sqrt(2)).tolist()


def scene_of(ground, launch=(), duration=1.0):
    ground = {"contact": "gated", "friction": 0.0, "damping": 0.0, **ground}
    return from_mapping({"ground": ground, "launch": dict(launch), "duration": duration})


def run(scene, model, steps, every=1):
    engine = pybullet.Pybullet(scene, model, start_of(scene, model), scene.duration / steps, 1e-9)
    states = np.zeros(steps // every, STATE)
    assert engine.advance(states, every) == steps
    return states


@pytest.mark.parametrize("stiffness", [1e2, 1e8])
@pytest.mark.parametrize("stride", [0.02, 0.7, 30.0])
def test_without_damping_a_flat_bounce_is_that_of_our_implicit_euler(stiffness, stride):
    """Step by step, at any ωh; a node that is fast is seen in time."""
    h = stride / math.sqrt(4 * stiffness)
    steps = min(500, math.ceil(3 / h))
    launch = {"position": [0, 0, 0.52 + 5 * h], "velocity": [0, 0, -10]}
    scene = scene_of({"stiffness": stiffness}, launch, steps * h)
    ours = simulate(scene, model="vertical", scheme="implicit_euler", steps=steps, every=1).trajectory.state[1:]
    np.testing.assert_allclose(run(scene, "vertical", steps)["position"], ours["position"], rtol=0, atol=1e-8)


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


@pytest.mark.parametrize(("orientation", "nodes"), [(CORNER, 1), (EDGE, 2), (FLAT, 4)])
@pytest.mark.parametrize("stiffness", [1e2, 1e8])
def test_each_node_is_a_spring_of_its_own(orientation, nodes, stiffness):
    """A cube that is put where k springs carry it stays there: m g/(kS) deep."""
    scene = scene_of({"stiffness": stiffness}, {"orientation": orientation, "velocity": [0, 0, 0]})
    launch = start_of(scene, "vertical")
    depth = scene.cube.mass * scene.gravity / (nodes * stiffness)
    launch["position"][:, 2] = -launch["node_offset"][..., 2].min() - depth
    states = np.zeros(200, STATE)
    pybullet.Pybullet(scene, "vertical", launch, 0.05 / math.sqrt(stiffness), 1e-9).advance(states, 10)
    assert np.abs(states["position"][:, 2] - launch["position"][0, 2]).max() < 1e-6 * depth + 1e-15


def test_a_cube_comes_to_rest_as_deep_as_its_weight_presses_it():
    scene = scene_of({"stiffness": 1e3, "damping": 10.0}, {"position": [0, 0, 0.52], "velocity": [0, 0, 0]}, 5.0)
    end = run(scene, "tumbling", 20_000, 20_000)[-1]
    assert scene.cube.side / 2 - end["position"][2] == pytest.approx(sag(scene), rel=1e-8)


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_friction_stops_a_sliding_cube_and_holds_it(model):
    """It slides u²/(2 mu g), straight, and then stands still."""
    scene = scene_of({"stiffness": 1e4, "friction": 0.3, "damping": 20.0}, {"velocity": [0.8, 0.6, 0]})
    launch = start_of(scene, model)
    launch["position"][:, 2] = scene.cube.side / 2 - sag(scene)
    states = np.zeros(1000, STATE)
    pybullet.Pybullet(scene, model, launch, 1e-4, 1e-9).advance(states, 10)
    far = states["position"][-1, :2]
    assert np.hypot(*far) == pytest.approx(1 / (2 * 0.3 * scene.gravity), rel=2e-3)
    assert far[1] / far[0] == pytest.approx(0.75, rel=2e-2 if model == "tumbling" else 2e-3)
    assert np.abs(states["velocity"][-1, :2]).max() < 1e-6


@pytest.mark.parametrize(("friction", "slides"), [(0.21, 0.0), (0.19, 0.01)])
def test_on_a_slope_a_cube_slides_only_beyond_the_coefficient(friction, slides):
    """Of one in five: it speeds up by g (sin − mu cos), or not at all."""
    normal = np.array([-0.2, 0, 1]) / math.hypot(0.2, 1)
    scene = scene_of({"stiffness": 1e4, "friction": friction, "normal": normal.tolist()}, {"velocity": [0, 0, 0]})
    launch = start_of(scene, "sliding")
    lowest = (launch["node_offset"][0] @ normal).min()
    depth = scene.gravity * normal[2] / (2 * scene.ground.stiffness)  # the two lower ones carry it
    launch["position"] = normal * (-lowest - depth)
    states = np.zeros(100, STATE)
    pybullet.Pybullet(scene, "sliding", launch, 1e-4, 1e-9).advance(states, 100)
    speed = -states["velocity"][-1, 0] / normal[2]
    assert speed == pytest.approx(slides * scene.gravity * normal[2], abs=1e-4)


def test_friction_acts_at_the_node_and_points_somewhat_aside():
    """What Bullet cannot do otherwise: along (v₁/a₁, v₂/a₂), not along the slip (v₁, v₂)."""
    scene = scene_of({"stiffness": 1e4, "friction": 0.1}, {"orientation": [0, 0.5, 0], "velocity": [1.0, 0.5, 0]})
    launch, depth, h = start_of(scene, "tumbling"), 0.02, 1e-7
    nodes = launch["node_offset"][0]
    lowest = nodes[nodes[:, 2].argsort()[:2]]
    launch["position"][:, 2] = -lowest[0, 2] - depth
    states = np.zeros(1, STATE)
    pybullet.Pybullet(scene, "tumbling", launch, h, 1e-9).advance(states, 1)
    push = 1e4 * depth
    felt, torque = np.zeros(3), np.zeros(3)
    for x, y, z in lowest:
        inverse = 1 + np.array([y * y + z * z, x * x + z * z]) / scene.cube.moment_of_inertia
        along = np.array([1.0, 0.5]) / inverse
        force = np.array([*(-0.1 * push * along / np.hypot(*along)), push])
        felt, torque = felt + force, torque + np.cross([x, y, z], force)
    change = (states["velocity"] - launch["velocity"])[0] / h + [0, 0, scene.gravity]
    np.testing.assert_allclose(change, felt, rtol=1e-4)
    np.testing.assert_allclose(states["angular_momentum"][0] / h, torque, rtol=1e-4, atol=1e-3)


def test_no_step_is_lost_in_a_division():
    """Of a thousand steps of h = 1/30000 s at once Bullet takes one less, once in fifty times. Nor is speed lost."""
    scene = scene_of({"stiffness": 1e4}, {"position": [0, 0, 1e4], "velocity": [0, 0, 500]}, 50 / 30)
    end = run(scene, "flying", 50_000, 1000)[-1]
    assert end["velocity"][2] == pytest.approx(500 - scene.gravity * scene.duration, rel=1e-11)


def test_a_run_that_leaves_the_numbers_says_nothing(capfd):
    scene = scene_of({"stiffness": 1e8}, {"velocity": [0, 0, -1e305], **TUMBLE})
    states = run(scene, "tumbling", 2000, 20)
    assert not np.isfinite(states["position"][-1]).all()
    assert capfd.readouterr() == ("", "")


def test_to_import_it_prints_nothing():
    code = "import stiffdice.simulation.engines.pybullet"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")


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
    why = pybullet.Pybullet.unfit(scene, "tumbling")
    assert (why is None) == (named is None)
    assert named is None or named in why
    assert pybullet.Pybullet.unfit(scene, "flying") is None
    assert why is None or "Bullet's " in why


def test_the_version_is_told():
    assert pybullet.Pybullet.version().startswith("pybullet ")
