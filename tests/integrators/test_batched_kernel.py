from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, Ensemble, physics_of
from stiffdice.integrators.registry import SCHEMES
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation import fixed_step
from stiffdice.simulation.initial_conditions import turned
from stiffdice.simulation.run import simulate

SPIN = [0.3, 0.5, 0.2]
PARTS = STATE.names


def scene_of(contact="ungated", duration=10.0, spin=SPIN, stiffness=1e4, **keys):
    launch = {"angular_momentum": spin} | keys.pop("launch", {})
    ground = {"contact": contact, "stiffness": stiffness} | keys.pop("ground", {})
    return from_mapping({"ground": ground, "launch": launch, "duration": duration} | keys)


def listed(scene, model, launches, steps, samples=1):
    """Members stepped one by one in the listing's order: states, shape (member, samples + 1)."""
    states = np.empty((len(launches), samples + 1), STATE)
    states[:, 0] = launches
    tags = SCHEMES["symplectic_euler"], MODELS[model]
    for member in states:
        fixed_step.advance(*tags, physics_of(scene), member, steps // samples, scene.duration / steps, 1e-9)
    return states


def batched(scene, model, launches, steps):
    """The last states of the same members, stepped side by side; gated, flights are taken at once."""
    return simulate(scene, model=model, steps=steps, members=Ensemble(launches, np.zeros(len(launches)))).end


def assert_close(states, expected, atol):
    for part in PARTS:
        np.testing.assert_allclose(states[part], expected[part], rtol=0, atol=atol, err_msg=part)


def apart(states, others):
    return np.linalg.norm(states["position"] - others["position"], axis=-1)


@pytest.mark.parametrize(
    ("model", "scene"),
    [
        ("vertical", scene_of("gated", 1.2)),
        ("vertical", scene_of("ungated", 1.2)),
        ("vertical", scene_of("gated", 1.2, launch={"orientation": [0.3, 0.2, 0.1]})),
        ("sliding", scene_of("ungated", 1.2)),
        ("sliding", scene_of("gated", 1.2)),
        ("sliding", scene_of("ungated", 1.2, launch={"orientation": [0.0, np.pi / 2, 0.0]})),
        ("tumbling", scene_of("ungated", 1.2)),
        ("tumbling", scene_of("gated", 1.2)),
        ("tumbling", scene_of("ungated", 0.8, ground={"normal": [0.2, -0.3, 1]}, launch={"node_velocity": "rigid"})),
        ("tumbling", scene_of("ungated", 0.8, cube={"inertia": "corners", "mass": 3, "radius": 0.7}, gravity=3.7)),
    ],
)
def test_before_the_first_bounce_it_is_the_listings_order_to_round_off(model, scene):
    launches = turned(scene, model, 5)
    states = batched(scene, model, launches, 2000)
    assert_close(states, listed(scene, model, launches, 2000)[:, -1], 1e-12)


def test_a_bounce_is_the_same_bounce():
    """Through it and up again: at S = 1e4, 100 steps long."""
    scene = scene_of("gated", 1.6)
    launches = turned(scene, "vertical", 70)
    launches["position"][:, 2] += np.linspace(0, 1e-2, 70)
    states = batched(scene, "vertical", launches, 10_000)
    assert (states["velocity"][:, 2] > 1).all()
    assert_close(states, listed(scene, "vertical", launches, 10_000)[:, -1], 1e-11)


@pytest.mark.parametrize(("contact", "stiffness"), [("ungated", 1e4), ("ungated", 1e6), ("gated", 1e4)])
def test_after_it_the_paths_part_as_those_of_two_launches_do_that_round_off_tells_apart(contact, stiffness):
    """The listing's kernel itself says how round-off grows: from launches off by half an ulp for each step's root.

    Stepping adds errors of half an ulp, N^(1/2)/2 of them in N steps to the first bounce; a launch off by that much
    parts from the other at the same rate, bounce by bounce, until both are anywhere (a cube is chaotic).
    """
    scene, steps, members = scene_of(contact, 5.0, stiffness=stiffness), 10_000, 64
    launches = turned(scene, "tumbling", members)
    path = listed(scene, "tumbling", launches, steps, 10)
    nudged = launches.copy()
    for part, seed in (("position", 1), ("velocity", 2), ("angular_momentum", 3)):
        sign = np.random.default_rng(seed).choice([-1, 1], (members, 3))
        nudged[part] += sign * np.sqrt(0.3 * steps) / 2 * np.spacing(np.abs(nudged[part]).max())
    parted = listed(scene, "tumbling", nudged, steps, 10)
    for sample in range(4, 11):
        until = scene_of(contact, 0.5 * sample, stiffness=stiffness)
        states = batched(until, "tumbling", launches, 1000 * sample)
        ours = np.log10(apart(states, path[:, sample]))
        theirs = np.log10(apart(parted[:, sample], path[:, sample]))
        # Of 64 distances spread over decades the median is known to 0.2 decades, the outer quantiles to 0.3.
        for quantile, within in ((0.1, 1.0), (0.5, 0.6), (0.9, 1.0)):
            assert abs(np.quantile(ours, quantile) - np.quantile(theirs, quantile)) < within


def test_a_member_that_turns_by_more_than_a_radian_in_a_step_is_turned_by_itself():
    scene = scene_of(duration=1.0)
    launches = turned(scene, "tumbling", 20)
    inertia = scene.cube.moment_of_inertia
    launches["angular_momentum"][:10] *= (np.geomspace(0.5, 20, 10) * 100 * inertia / np.linalg.norm(SPIN))[:, None]
    assert_close(
        batched(scene, "tumbling", launches, 100),
        listed(scene, "tumbling", launches, 100)[:, -1],
        1e-11,
    )


def out_of_range(states):
    return ~np.all([np.isfinite(states[part]).reshape(len(states), -1).all(axis=1) for part in PARTS], axis=0)


FAR_TOO_STIFF = {
    "stiffness": 2e301,
    "ground": {"damping": 0},
    "cube": {"mass": 1e-6},
    "launch": {"position": [0, 0, 1e4]},
    "spin": [0, 0, 0],
    "duration": 1000.0,
}


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_runs_that_blow_up_do_and_no_others(model):
    scene = scene_of(**FAR_TOO_STIFF)
    launches = turned(scene, model, 5)
    launches["position"][2, 2] = 1e12
    states, expected = batched(scene, model, launches, 100), listed(scene, model, launches, 100)[:, -1]
    np.testing.assert_array_equal(out_of_range(states), [True, True, False, True, True])
    np.testing.assert_array_equal(out_of_range(expected), out_of_range(states))
    np.testing.assert_allclose(states["position"][2], expected["position"][2], rtol=1e-12)


@pytest.mark.parametrize("contact", ["gated", "ungated"])
@pytest.mark.parametrize(
    "keys",
    [
        {"ground": {"normal": [0.2, -0.3, 0.933]}},
        {"cube": {"geometry": "exact", "inertia": "corners", "mass": 0.3, "radius": 0.4}},
        {"launch": {"node_velocity": "rigid", "orientation": [0.4, -0.2, 0.9]}, "ground": {"friction": 1}},
        {"gravity": 0, "launch": {"velocity": [3, 1, -4]}},
    ],
    ids=["slope", "cube", "launch", "weightless"],
)
def test_one_step_is_the_listings_step_anywhere_on_the_way(contact, keys):
    """Step by step from states in the air, on a corner and in between: no difference has time to grow."""
    keys = keys | {"ground": {"damping": 0.3} | keys.get("ground", {})}
    path = simulate(scene_of(contact, 4.0, **keys), model="tumbling", steps=4000, every=1).trajectory.state
    assert (np.diff(path["angular_momentum"], axis=0) != 0).any()  # it does touch the ground
    states = batched(scene_of(contact, 1e-3, **keys), "tumbling", path[:-1], 1)
    for part in PARTS:
        size = np.abs(path[part]).max()
        # Ungated, friction acts in the air, too, and amplifies round-off where a node's slip turns around.
        within = 2e-14 if contact == "gated" else 1e-13
        np.testing.assert_allclose(states[part], path[part][1:], rtol=0, atol=within * size, err_msg=part)


def test_a_spin_of_any_rate_turns_the_cube_as_rodrigues_says():
    """Both the series of a step and the functions of one beyond a radian."""
    for spin in (1e-9, 0.05, 3.0, 240.0, 2600.0, 40_000.0):
        scene = scene_of("ungated", 0.1, [spin / 7, spin / 5, -spin / 9])
        launches = turned(scene, "tumbling", 1)
        states, expected = batched(scene, "tumbling", launches, 100), listed(scene, "tumbling", launches, 100)[:, -1]
        assert_close(states, expected, 1e-13 * (1 + spin))
