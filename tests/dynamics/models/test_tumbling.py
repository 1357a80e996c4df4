from __future__ import annotations

import numpy as np
import pytest
from tests.conftest import columns

from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate


def test_the_throw_listings_numbers_to_1e_9_until_round_off_takes_over(reference):
    given = reference("throw_L1")
    run = simulate(given.scene, model="tumbling", steps=given.steps, every=given.every)
    kept = run.trajectory.state[1 : len(given.table) + 1]
    assert given.table["t"][-1] >= 3.88
    close = {"rtol": 0, "atol": 1e-9}
    np.testing.assert_allclose(kept["position"], columns(given.table, "x", "y", "z"), **close)
    np.testing.assert_allclose(kept["velocity"], columns(given.table, "ux", "uy", "uz"), **close)
    np.testing.assert_allclose(kept["angular_momentum"], columns(given.table, "Lx", "Ly", "Lz"), **close)
    for node in range(8):
        names = [f"Xrel{node + 1}{axis}" for axis in "xyz"]
        np.testing.assert_allclose(kept["node_offset"][:, node], columns(given.table, *names), **close)
    energy = run.trajectory.energy_paper[1 : len(given.table) + 1]
    np.testing.assert_allclose(energy, given.table["energy"], **close)


def thrown(steps=2000, every=10, **keys):
    return simulate(from_mapping(keys), model="tumbling", steps=steps, every=every)


@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_zero_spin_is_no_division_by_zero(contact):
    """A flat landing without friction turns nothing: the cube stays upright, and moves as the sliding one."""
    scene = from_mapping({"ground": {"contact": contact, "friction": 0}})
    tumbling, sliding = (
        simulate(scene, model=model, steps=10_000, every=100).trajectory.state for model in ("tumbling", "sliding")
    )
    np.testing.assert_allclose(tumbling["node_offset"], sliding["node_offset"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(tumbling["position"], sliding["position"], rtol=0, atol=1e-9)


def test_friction_tips_a_flat_landing():
    spun = thrown(steps=5000, ground={"contact": "gated"}).trajectory.state["angular_momentum"]
    assert np.abs(spun[-1]).max() > 0.01


def test_the_cube_is_rigid():
    offsets = thrown(steps=20_000, ground={"stiffness": 1e4}, launch={"angular_momentum": [0.3, 0.5, 0.2]})
    gram = np.einsum("tia,tja->tij", *[offsets.trajectory.state["node_offset"]] * 2)
    np.testing.assert_allclose(gram, np.broadcast_to(gram[0], gram.shape), rtol=0, atol=1e-11)


def test_free_rotation_keeps_momentum_and_turns_at_its_rate():
    spin = np.array([0.3, -0.2, 0.6])
    run = thrown(
        ground={"contact": "gated"}, launch={"position": [0, 0, 100], "angular_momentum": list(spin)}, duration=2.0
    )
    state, scene = run.trajectory.state, run.scene
    np.testing.assert_array_equal(state["angular_momentum"], np.broadcast_to(spin, (len(state), 3)))
    axis = spin / np.linalg.norm(spin)
    angle = np.linalg.norm(spin) / scene.cube.moment_of_inertia * run.trajectory.time[-1]
    before, after = state["node_offset"][0, 0], state["node_offset"][-1, 0]
    turned = (
        axis * (axis @ before)
        + np.cos(angle) * (before - axis * (axis @ before))
        + np.sin(angle) * np.cross(axis, before)
    )
    np.testing.assert_allclose(after, turned, rtol=0, atol=1e-12)


def test_the_first_step_of_the_listing_ignores_the_spin_of_the_nodes():
    """As listed U starts as u_cm; by equation 5 it has ω × X, which the ungated drag feels at once."""
    falling = {"velocity": [0, 0, -5], "angular_momentum": [0, 2.0, 0]}
    first = {}
    for start in ("translation", "rigid"):
        keys = {"ground": {"friction": 0}, "launch": falling | {"node_velocity": start}}
        first[start] = thrown(steps=1000, every=1, **keys).trajectory.state["angular_momentum"][1, 1]
    assert first["translation"] == pytest.approx(2.0, abs=1e-13)
    assert first["rigid"] < 2.0 - 1e-4


def test_both_starts_agree_for_a_gated_launch_in_the_air():
    keys = {"ground": {"contact": "gated"}}
    spin = {"angular_momentum": [0.1, 0.2, 0.3]}
    a, b = (
        thrown(**keys, launch=spin | {"node_velocity": start}).trajectory.state["position"]
        for start in ("translation", "rigid")
    )
    np.testing.assert_array_equal(a, b)


def test_a_cube_turned_at_launch_is_the_cube_turned():
    turn = [0, 0, np.pi / 2]  # a quarter turn about z takes a cube into itself
    plain, turned = (
        thrown(ground={"contact": "gated"}, launch={"orientation": o}).trajectory.state["position"]
        for o in ([0, 0, 0], turn)
    )
    np.testing.assert_allclose(plain[:100], turned[:100], rtol=0, atol=1e-9)


def test_spin_about_the_normal_is_braked_by_friction():
    keys = {"ground": {"friction": 0.5, "damping": 5, "contact": "gated"}, "duration": 2.0}
    launch = {"position": [0, 0, 0.517], "velocity": [0, 0, 0], "angular_momentum": [0, 0, 0.5]}
    spin = thrown(steps=20_000, every=1000, **keys, launch=launch).trajectory.state["angular_momentum"][:, 2]
    assert spin[0] == 0.5
    assert np.all(np.diff(spin)[:3] < 0)
    assert abs(spin[-1]) < 0.01
