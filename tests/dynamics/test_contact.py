"""The contact laws at their thresholds, and a whole run against a second, plain implementation."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import normal_force, normal_slopes
from stiffdice.dynamics.state import physics_of
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate


def one_step(height, contact, speed=-1.0, **ground):
    """Velocity along z after one step of a cube whose lowest nodes are at this height."""
    scene = from_mapping(
        {
            "cube": {"geometry": "exact", "radius": np.sqrt(3)},  # side 2: the nodes are at ±1 exactly
            "ground": {"stiffness": 100, "damping": 3, "friction": 0, "contact": contact, **ground},
            "launch": {"position": [0, 0, 1.0 + height], "velocity": [0, 0, speed]},
            "gravity": 0,
            "duration": 1e-3,
        }
    )
    return simulate(scene, model="sliding", steps=1, every=1).trajectory.state["velocity"][1, 2]


H = 1e-3


def test_a_node_on_the_ground_is_not_below_it():
    assert one_step(0.0, "gated") == -1.0
    assert one_step(-1e-12, "gated") == pytest.approx(-1 + 4 * 3 * H, abs=1e-9)


def test_a_node_above_the_ground_feels_the_ungated_law_only_when_it_falls():
    assert one_step(0.5, "gated") == -1.0
    assert one_step(0.5, "ungated") == pytest.approx(-1 + 8 * 3 * H, abs=1e-12)
    assert one_step(0.5, "ungated", speed=1.0) == 1.0


@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_the_ground_pushes_and_never_pulls(contact):
    rising = one_step(-0.01, contact, speed=5.0)  # S d = 1 N against D u = 15 N
    assert rising == 5.0


@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_depth_pushes_back(contact):
    top = 8 if contact == "ungated" else 4
    assert one_step(-0.01, contact) == pytest.approx(-1 + (4 * 100 * 0.01 + top * 3) * H, abs=1e-12)


def stepped(scene, steps, gated):
    """The paper's throw in plain NumPy: all nodes at every step, no shortcut for a flight."""
    cube, ground = scene.cube, scene.ground
    n = np.array(ground.normal)
    x, u = np.array(scene.launch.position), np.array(scene.launch.velocity)
    spin = np.array(scene.launch.spin)
    nodes, omega = cube.node_offsets(), spin / cube.moment_of_inertia
    h = scene.duration / steps
    places = [x]
    for _ in range(steps):
        velocity = u + np.cross(omega, nodes)
        depth = -(x + nodes) @ n
        along = velocity @ n
        push = np.maximum(0, ground.stiffness * np.maximum(0, depth) - ground.damping * along)
        if gated:
            push = np.where(depth > 0, push, 0)
        tangential = velocity - np.outer(along, n)
        size = np.linalg.norm(tangential, axis=1, keepdims=True) + 1e-6 * cube.radius
        force = push[:, None] * n - ground.friction * push[:, None] * tangential / size
        force[:, 2] -= cube.mass / 8 * scene.gravity
        u = u + h * force.sum(axis=0) / cube.mass
        x = x + h * u
        spin = spin + h * np.cross(nodes, force).sum(axis=0)
        omega = spin / cube.moment_of_inertia
        rate = np.linalg.norm(omega)
        axis = omega / rate
        turned = np.cos(rate * h) * (nodes - np.outer(nodes @ axis, axis)) + np.sin(rate * h) * np.cross(axis, nodes)
        nodes = np.outer(nodes @ axis, axis) + turned
        places.append(x)
    return np.array(places)


@pytest.mark.parametrize("contact", ["ungated", "gated"])
@pytest.mark.parametrize("normal", [[0, 0, 1], [0.3, -0.1, 1.0]], ids=["flat", "slope"])
@pytest.mark.long
def test_a_throw_against_a_second_implementation(contact, normal):
    scene = from_mapping(
        {
            "ground": {"stiffness": 2e3, "damping": 0.3, "friction": 0.2, "contact": contact, "normal": normal},
            "launch": {"angular_momentum": [0.3, 0.5, -0.2], "node_velocity": "rigid"},
            "duration": 3.0,
        }
    )
    ours = simulate(scene, model="tumbling", steps=6000, every=1).trajectory.state["position"]
    theirs = stepped(scene, 6000, gated=contact == "gated")
    assert (ours[:, 2] < 1).any()  # it did land
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)


@njit
def _normal(physics, depth, speed):
    return normal_force(physics, depth, speed), normal_slopes(physics, depth, speed)


def _ground(contact):
    return physics_of(from_mapping({"ground": {"contact": contact, "stiffness": 100.0, "damping": 1.5}}))


@pytest.mark.parametrize("contact", CONTACT_LAWS)
@pytest.mark.parametrize("depth", [-0.3, -1e-3, 2e-3, 0.5])
@pytest.mark.parametrize("speed", [-2.0, -0.1, 0.03, 3.0, 80.0])
def test_slopes_are_those_of_the_force(contact, depth, speed):
    """Against differences, at points to either side of every kink of the law, pushing and not."""
    physics, off = _ground(contact), 1e-7
    _, (by_depth, by_speed) = _normal(physics, depth, speed)
    deeper, shallower = (_normal(physics, depth + s, speed)[0] for s in (off, -off))
    faster, slower = (_normal(physics, depth, speed + s)[0] for s in (off, -off))
    assert by_depth == pytest.approx((deeper - shallower) / (2 * off), rel=1e-6)
    assert by_speed == pytest.approx((faster - slower) / (2 * off), rel=1e-6)
    assert by_depth in (0, 100.0)
    assert by_speed in (0, -1.5)


@pytest.mark.parametrize("contact", CONTACT_LAWS)
def test_a_ground_that_does_not_push_has_no_slope(contact):
    """At the kinks themselves, too: on the ground at rest, and where damping pulls as much as the spring pushes."""
    for depth, speed in ((0.0, 0.0), (0.0, 1.0), (0.03, 2.0)):
        force, slopes = _normal(_ground(contact), depth, speed)
        assert (force, slopes) == (0, (0, 0))
