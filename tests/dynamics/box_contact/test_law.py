"""What two boxes do to each other: momentum is kept, frames and names do not matter, damping and friction only take."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.dynamics.box_contact.two_boxes import scene

from stiffdice.dynamics.box_contact import law
from stiffdice.dynamics.box_contact.pair_state import pair_physics_of, pair_start_of

SIDES = [1.0, 1.2, 0.7], [0.8, 0.9, 1.1]


def meetings(count=60, seed=0, **ground):
    """Return the physics and states of two boxes of unlike sides that overlap at most a little, moving and spinning."""
    rng = np.random.default_rng(seed)
    two = scene([0, 0, 0], [5, 0, 0], sides=SIDES, stiffness=1e4, **ground)
    physics, start = pair_physics_of(two), pair_start_of(two)[0]
    states = np.repeat(pair_start_of(two), count)
    for name, places in (("a", np.zeros((count, 3))), ("b", rng.normal(size=(count, 3)))):
        states[name]["node_offset"] = [
            turn.apply(start[name]["node_offset"]) for turn in Rotation.random(count, random_state=rng)
        ]
        states[name]["position"] = 0.95 * places / np.linalg.norm(places, axis=1, keepdims=True).clip(0.1)
        for part in ("velocity", "angular_velocity"):
            states[name][part] = rng.normal(size=(count, 3))
    touching = law.evaluate(physics, states)[0] > 0
    assert touching.sum() > count / 4
    return physics, states[touching]


def changed(states, turn=None, shift=(0, 0, 0), boost=(0, 0, 0)):
    """Return states seen from another frame."""
    turn = turn or Rotation.identity()
    result = states.copy()
    for name in "ab":
        for part in ("position", "velocity", "angular_velocity"):
            result[name][part] = turn.apply(states[name][part])
        result[name]["position"] += shift
        result[name]["velocity"] += boost
        nodes = states[name]["node_offset"]
        result[name]["node_offset"] = turn.apply(nodes.reshape(-1, 3)).reshape(nodes.shape)
    return result


def swapped(physics, states):
    result = states.copy()
    result["a"], result["b"] = states["b"], states["a"]
    return physics._replace(a=physics.b, b=physics.a, half_a=physics.half_b, half_b=physics.half_a), result


@pytest.mark.parametrize("ground", [{}, {"damping": 3.0, "friction": 0.4}])
def test_momentum_is_kept_about_any_origin(ground):
    physics, states = meetings(**ground)
    _, wrenches = law.evaluate(physics, states)
    force, torque = wrenches[..., :3], wrenches[..., 3:]
    scale = np.abs(force).max(axis=(1, 2))
    assert (force[:, 0] + force[:, 1] == 0).all()
    for origin in ([0, 0, 0], [3, -2, 7]):
        about = sum(
            np.cross(states[name]["position"] - origin, force[:, k]) + torque[:, k] for k, name in enumerate("ab")
        )
        assert (np.abs(about).max(axis=1) < 1e-13 * scale).all()


@pytest.mark.parametrize("ground", [{}, {"damping": 3.0, "friction": 0.4}])
def test_which_box_is_the_first_changes_nothing(ground):
    physics, states = meetings(seed=1, **ground)
    energy, wrenches = law.evaluate(physics, states)
    other_energy, other = law.evaluate(*swapped(physics, states))
    assert other_energy == pytest.approx(energy, rel=1e-12)
    assert other[:, ::-1] == pytest.approx(wrenches, rel=1e-9, abs=1e-9 * np.abs(wrenches).max())


@pytest.mark.parametrize("ground", [{}, {"damping": 3.0, "friction": 0.4}])
def test_forces_turn_with_the_frame_and_do_not_see_where_it_is_or_how_it_moves(ground):
    physics, states = meetings(seed=2, **ground)
    energy, wrenches = law.evaluate(physics, states)
    turn = Rotation.from_rotvec([0.3, -1.2, 0.8])
    seen_energy, seen = law.evaluate(physics, changed(states, turn, (2, -1, 3), (4, 5, -6)))
    back = turn.inv().apply(seen.reshape(-1, 3)).reshape(wrenches.shape)
    assert seen_energy == pytest.approx(energy, rel=1e-10)
    assert back == pytest.approx(wrenches, rel=1e-8, abs=1e-9 * np.abs(wrenches).max())


def test_damping_and_friction_never_give_energy():
    physics, states = meetings(count=300, seed=3, damping=20.0, friction=0.5)
    _, all_of_it = law.evaluate(physics, states)
    _, springs = law.evaluate(physics._replace(damping=0.0, friction=0.0), states)
    power = sum(
        np.einsum("kx,kx->k", (all_of_it - springs)[:, k, :3], states[name]["velocity"])
        + np.einsum("kx,kx->k", (all_of_it - springs)[:, k, 3:], states[name]["angular_velocity"])
        for k, name in enumerate("ab")
    )
    assert power.max() <= 1e-9
    assert power.min() < -1


def test_damping_does_not_pull():
    """Two cubes flush and parting fast feel nothing, however strong the damping."""
    two = scene({"position": [0, 0, 0]}, {"position": [0, 0, 0.999], "velocity": [0, 0, 50]}, damping=30.0)
    physics, state = pair_physics_of(two), pair_start_of(two)
    assert law.evaluate(physics, state)[1] == pytest.approx(0, abs=1e-12)
    state["b"]["velocity"] = 0
    assert law.evaluate(physics, state)[1][0, 1, 2] == pytest.approx(4e-3, rel=1e-9)


def test_damping_is_bounded_where_an_edge_grazes_a_plane():
    """There q is some 10⁷ long: a dashpot that acts on q·u, and along q, takes more speed in a step than there is."""
    turn = Rotation.from_rotvec([0, 1e-7, 0])
    forces = []
    for damping in (0.0, 3.0):
        two = scene([0, 0, 0], [0.99, 0.5, 0], stiffness=1e4, damping=damping)
        states = np.repeat(pair_start_of(two), 2001)
        states["b"]["position"][:, 2] = np.linspace(-6e-8, 6e-8, len(states))
        states["b"]["node_offset"] = turn.apply(states["b"]["node_offset"][0])
        states["b"]["velocity"] = -0.1, 0.2, 0.7
        forces.append(law.evaluate(pair_physics_of(two), states)[1][:, 0, :3])
    speed = np.linalg.norm([0.1, 0.2, 0.7])
    assert np.linalg.norm(forces[1] - forces[0], axis=1).max() < 5 * 3.0 * speed
