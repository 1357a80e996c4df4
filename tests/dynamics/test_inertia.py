"""Torque-free motion of a box: its orders, what it keeps, and the flip about the middle axis."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from stiffdice.dynamics.state import turned_tensor
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate

# By scheme: the order of the orientation in a flight without torque. L is constant for all, so that those which drift
# by the symmetric splitting have its order, whatever theirs is in a contact.
ORDERS = {
    "symplectic_euler": 2,
    "forward_euler": 2,
    "implicit_euler": 2,
    "velocity_verlet": 2,
    "rk4": 4,
}
MIDDLE = "[0.01, 3, 0.02] rad/s"  # about the axis of the middle moment, but for a nudge


def afloat(spin=MIDDLE, duration=4.0, **cube):
    return from_mapping(
        {
            "cube": {"sides": [1, 2, 3], "mass": 2.0, **cube},
            "ground": {"contact": "gated"},
            "launch": {"position": [0, 0, 1e3], "velocity": [0, 0, 0], "angular_momentum": spin},
            "gravity": 0,
            "duration": duration,
        }
    )


def exact_nodes(scene):
    """Nodes at the end by Euler's equations, integrated by SciPy."""
    nodes, momentum = scene.cube.node_offsets(), np.array(scene.launch.spin)

    def rate(_, matrix):
        turn = matrix.reshape(3, 3)
        spin = turn @ np.linalg.solve(scene.cube.distribution.tensor, turn.T @ momentum)
        return np.cross(spin, turn, axisb=0, axisc=0).ravel()

    end = solve_ivp(rate, (0, scene.duration), np.eye(3).ravel(), method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    return nodes @ end.reshape(3, 3).T


LOAD = {"load": {"at": "corner", "mass": 0.5}}


@pytest.mark.parametrize(
    "scheme",
    [
        pytest.param(scheme, marks=pytest.mark.broad) if scheme in ("forward_euler", "implicit_euler") else scheme
        for scheme in ORDERS
    ],
)
def test_schemes_have_their_orders_without_torque(scheme):
    scene = afloat("[1, 2, -1] rad/s", **LOAD)
    best = exact_nodes(scene)
    errors = [np.abs(simulate(scene, scheme=scheme, steps=n).end["node_offset"][0] - best).max() for n in (400, 800)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[scheme], abs=0.15)


@pytest.mark.broad
def test_event_is_right_to_its_tolerance():
    scene = afloat("[1, 2, -1] rad/s", **LOAD)
    for tolerance in (1e-6, 1e-9, 1e-12):
        end = simulate(scene, scheme="event", steps=3, tolerance=tolerance).end["node_offset"][0]
        assert np.abs(end - exact_nodes(scene)).max() < 200 * tolerance


def test_the_splitting_keeps_momentum_and_bounds_the_error_of_the_energy():
    """Over some fifty turns: the energy's error does not grow, and falls by four with half the step."""
    worst = []
    for steps in (2000, 4000):
        run = simulate(afloat(duration=100.0), steps=steps, every=10)
        energy, momentum = run.trajectory.kinetic_energy, run.trajectory.state["angular_momentum"]
        assert (momentum == momentum[0]).all()
        error = np.abs(energy / energy[0] - 1)
        assert error[len(error) // 2 :].max() < 1.1 * error[: len(error) // 2].max()
        worst.append(error.max())
    assert worst[0] / worst[1] == pytest.approx(4, abs=0.3)


@pytest.mark.parametrize(("axis", "flips"), [(0, False), (1, True), (2, False)])
def test_it_flips_about_the_middle_axis_alone(axis, flips):
    """Dzhanibekov's effect: about the axis of the middle moment a spin is not stable, about the others it is."""
    spin = np.full(3, 0.01)
    spin[axis] = 3.0
    nodes = simulate(afloat(f"{spin.tolist()} rad/s", duration=20.0), steps=4000, every=10).trajectory.state
    edge = nodes["node_offset"][:, 0] - nodes["node_offset"][:, (3, 1, 4)[axis]]
    cosine = edge @ edge[0] / (edge[0] @ edge[0])
    assert (cosine.min() < -0.99) == flips
    assert flips or cosine.min() > 0.99


def test_the_middle_axis_flips_after_the_exact_time():
    """The half period between flips is that of Jacobi's functions: 2 K(k)/λ (Landau and Lifshitz, Mechanics, §37)."""
    from scipy.special import ellipk

    scene = afloat("[0, 3, 0.02] rad/s", duration=40.0)
    high, middle, low = np.sort(np.diag(scene.cube.distribution.tensor))[::-1]
    run = simulate(scene, scheme="rk4", steps=8000, every=1)
    momentum = np.array(scene.launch.spin)
    square, twice = momentum @ momentum, 2 * run.trajectory.kinetic_energy[0]
    assert twice * low < square < twice * high
    # Names such that the motion encircles the axis of the largest moment, or of the least.
    if square > twice * middle:
        rate = np.sqrt((high - middle) * (square - twice * low) / (high * middle * low))
        k2 = (middle - low) * (twice * high - square) / ((high - middle) * (square - twice * low))
    else:
        rate = np.sqrt((middle - low) * (twice * high - square) / (high * middle * low))
        k2 = (high - middle) * (square - twice * low) / ((middle - low) * (twice * high - square))
    edge = run.trajectory.state["node_offset"][:, 0] - run.trajectory.state["node_offset"][:, 1]
    signs = np.sign(edge @ momentum)
    crossings = run.trajectory.time[1:][signs[1:] != signs[:-1]]
    np.testing.assert_allclose(np.diff(crossings), 2 * ellipk(k2) / rate, rtol=1e-3)
    assert len(crossings) > 2


def test_a_cube_with_a_box_of_equal_moments_pays_nothing():
    """Isotropic bodies are compiled as the cube of the paper is, whatever their moments are."""
    from stiffdice.dynamics.inertia import Box, Isotropic, body_of

    for cube in ({}, {"side": 1, "moments": [0.2, 0.2, 0.2]}, {"side": 1, "node_masses": [1] * 8}):
        assert isinstance(body_of(from_mapping({"cube": cube}).cube), Isotropic)
    assert isinstance(body_of(from_mapping({"cube": {"sides": [1, 1, 1.001]}}).cube), Box)


def thrown(**ground):
    return from_mapping(
        {
            "cube": {"sides": [1, 0.8, 0.5], "mass": 2.0, "load": {"at": "corner", "mass": 0.3}},
            "ground": {"contact": "gated", "stiffness": 2000.0, "damping": 6.0, "friction": 0.2, **ground},
            "launch": {
                "position": [0, 0, 1.5],
                "velocity": [1, 0, -1],
                "orientation": [0.3, 0.5, -0.2],
                "angular_momentum": "[2, 3, -1] rad/s",
                "node_velocity": "rigid",
            },
            "duration": 0.75,
        }
    )


def independent_end(scene):
    """Place and nodes by SciPy, from forces and a tensor written anew."""
    cube, ground = scene.cube, scene.ground
    half = np.array(cube.sides) / 2
    centre = cube.load.mass / cube.mass * half  # the load is at the corner of faces 1, 2, 3
    rest = cube.mass - cube.load.mass
    box = rest / 3 * np.diag([half[1] ** 2 + half[2] ** 2, half[0] ** 2 + half[2] ** 2, half[0] ** 2 + half[1] ** 2])

    def point(mass, arm):
        return mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))

    tensor = box + point(rest, centre) + point(cube.load.mass, half - centre)
    signs = np.array([[x, y, z] for z in (1, -1) for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))])
    nodes = signs * half - centre
    start = Rotation.from_rotvec(scene.launch.orientation).as_matrix()

    def rate(_, y):
        place, velocity, momentum, turn = y[:3], y[3:6], y[6:9], y[9:].reshape(3, 3)
        spin = turn @ np.linalg.solve(tensor, turn.T @ momentum)
        force, torque = np.array([0, 0, -cube.mass * scene.gravity]), np.zeros(3)
        for arm in nodes @ turn.T:
            depth, moving = -(place[2] + arm[2]), velocity + np.cross(spin, arm)
            if depth > 0:
                push = max(0.0, ground.stiffness * depth - ground.damping * moving[2])
                slip = np.array([moving[0], moving[1], 0.0])
                on = [0, 0, push] - ground.friction * push * slip / (np.linalg.norm(slip) + 1e-6 * cube.radius)
                force, torque = force + on, torque + np.cross(arm, on)
        turning = np.cross(spin, turn, axisb=0, axisc=0)
        return np.concatenate([velocity, force / cube.mass, torque, turning.ravel()])

    spin = np.array([2, 3, -1])
    y = np.concatenate([scene.launch.position, scene.launch.velocity, start @ tensor @ start.T @ spin, start.ravel()])
    end = solve_ivp(rate, (0, scene.duration), y, method="DOP853", rtol=1e-9, atol=1e-11, max_step=2e-3).y[:, -1]
    return end[:3], nodes @ end[9:].reshape(3, 3).T


@pytest.fixture(scope="module")
def off():
    """How far from other code a loaded box that is thrown ends, with impacts and friction, by how it is simulated."""
    scene = thrown()
    place, nodes = independent_end(scene)

    def distance(**how):
        end = simulate(scene, **how).end[0]
        return max(np.abs(end["position"] - place).max(), np.abs(end["node_offset"] - nodes).max())

    return distance


@pytest.mark.broad
def test_a_loaded_box_that_is_thrown_is_where_other_code_has_it_by_event(off):
    """To the accuracy of the other code."""
    assert off(scheme="event", steps=10, tolerance=1e-11) < 1e-7


@pytest.mark.long
def test_a_loaded_box_that_is_thrown_is_where_other_code_has_it(off):
    """By the listings' scheme at its first order."""
    coarse, fine = off(steps=20_000), off(steps=40_000)
    assert fine < 2e-4
    assert coarse / fine == pytest.approx(2, abs=1)
    assert off(scheme="velocity_verlet", steps=40_000) < 5e-5
    assert off(scheme="rk4", steps=40_000) < 1e-4


@pytest.mark.parametrize("contact", ["gated", "ungated"])
def test_members_side_by_side_move_as_the_listings_order_has_it(contact):
    """Until friction holds a node: there round-off grows a millionfold."""
    scene = dataclasses.replace(thrown(contact=contact), duration=0.5)
    stepped, abreast = simulate(scene, steps=2000, every=2000).end[0], simulate(scene, steps=2000).end[0]
    for name in ("position", "velocity", "angular_momentum", "angular_velocity", "node_offset"):
        np.testing.assert_allclose(abreast[name], stepped[name], rtol=0, atol=1e-10)


def test_the_tensor_of_the_nodes_is_that_of_a_turned_box():
    scene = thrown()
    state = simulate(scene, steps=1000).end[0]
    moments = np.linalg.eigvalsh(turned_tensor(scene.cube, state["node_offset"]))
    np.testing.assert_allclose(moments, np.linalg.eigvalsh(scene.cube.distribution.tensor), rtol=1e-12)
    spin = np.linalg.solve(turned_tensor(scene.cube, state["node_offset"]), state["angular_momentum"])
    np.testing.assert_allclose(state["angular_velocity"], spin, rtol=1e-10)
