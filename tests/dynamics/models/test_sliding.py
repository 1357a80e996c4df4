from __future__ import annotations

import numpy as np
import pytest
from tests.conftest import columns

from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate

SCENES = ["base", "fig6_mu0", "fig7_D0", "fig8_S10", "fig9_10_S1e6_1e4"]


@pytest.mark.parametrize("name", SCENES)
def test_the_listings_numbers_to_1e_12_over_the_whole_run(reference, name):
    given = reference(name)
    run = simulate(given.scene, model=given.model, steps=given.steps, every=given.every)
    kept = run.trajectory
    rows = slice(1, None)  # the listing stores no state before the first step
    np.testing.assert_allclose(kept.time[rows], given.table["t"], rtol=0, atol=1e-14)
    np.testing.assert_allclose(kept.state["position"][rows], columns(given.table, "x", "y", "z"), rtol=0, atol=1e-12)
    np.testing.assert_allclose(kept.state["velocity"][rows], columns(given.table, "ux", "uy", "uz"), rtol=0, atol=1e-12)
    for ours, theirs in (
        (kept.kinetic_energy, "kinetic"),
        (kept.potential_energy, "potential"),
        (kept.energy_paper, "energy"),
    ):
        np.testing.assert_allclose(ours[rows], given.table[theirs], rtol=0, atol=1e-12 * 100)  # of about 100 J


@pytest.mark.parametrize("name", SCENES)
def test_the_extremes_over_all_steps(reference, name):
    given = reference(name)
    kept = simulate(given.scene, model="sliding", steps=given.steps, every=1).trajectory
    assert kept.state["position"][1:, 2].min() == pytest.approx(given.whole_run["min_z_all_steps"], abs=1e-12)
    assert kept.energy_paper[1:].max() == pytest.approx(given.whole_run["max_E_all_steps"], abs=1e-10)


@pytest.mark.parametrize("contact", ["ungated", "gated"])
@pytest.mark.parametrize("turn", [np.roll(np.eye(3), k, axis=0) for k in (1, 2)], ids=["x", "y"])
def test_a_wall_is_a_floor_turned_over(contact, turn):
    """Without gravity no direction is special: turning ground and launch turns the trajectory."""

    def thrown(rotation):
        scene = from_mapping(
            {
                "ground": {"stiffness": 1e4, "contact": contact, "normal": list(rotation @ [0, 0, 1.0])},
                "launch": {"position": list(rotation @ [0, 0, 1.5]), "velocity": list(rotation @ [2.0, 1.0, -3.0])},
                "gravity": 0,
                "duration": 1,
            }
        )
        return simulate(scene, model="sliding", steps=3000, every=100).trajectory.state

    floor, wall = thrown(np.eye(3)), thrown(turn)
    np.testing.assert_allclose(wall["position"], floor["position"] @ turn.T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(wall["velocity"], floor["velocity"] @ turn.T, rtol=0, atol=1e-12)


def test_a_cube_on_a_slope_slides_down_as_newton_says():
    """mu < tan(angle): the acceleration along the slope is g (sin − mu cos)."""
    angle, mu, g = np.radians(40), 0.3, 9.8
    normal = np.array([np.sin(angle), 0, np.cos(angle)])
    downhill = np.array([np.cos(angle), 0, -np.sin(angle)])
    scene = from_mapping(
        {
            "ground": {"stiffness": 1e5, "damping": 50, "friction": mu, "contact": "gated", "normal": list(normal)},
            "launch": {
                "position": list(0.5176 * normal),
                "velocity": list(0.1 * downhill),
                "orientation": [0, angle, 0],  # flat on the slope
            },
            "gravity": g,
            "duration": 2.0,
        }
    )
    state = simulate(scene, model="sliding", steps=200_000, every=20_000).trajectory.state
    speed = state["velocity"] @ downhill
    expected = g * (np.sin(angle) - mu * np.cos(angle))
    assert (speed[-1] - speed[-5]) / 0.8 == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_spin_is_left_out(contact):
    scene = from_mapping({"ground": {"contact": contact}, "launch": {"angular_momentum": [0.3, 0.5, 0.2]}})
    still = from_mapping({"ground": {"contact": contact}})
    a, b = (simulate(s, model="sliding", steps=3000, every=100).trajectory for s in (scene, still))
    np.testing.assert_array_equal(a.state["position"], b.state["position"])
    np.testing.assert_array_equal(a.energy_paper, b.energy_paper)
