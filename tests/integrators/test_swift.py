import dataclasses

import numpy as np
import pytest

from stiffdice.dynamics.state import STATE
from stiffdice.errors import InputError
from stiffdice.integrators import registry as schemes
from stiffdice.integrators import swift
from stiffdice.scene import scene as scenes
from stiffdice.simulation import fixed_step
from stiffdice.simulation.criteria.registry import CRITERIA, criteria_of
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.run import simulate

MODELS = ("vertical", "sliding", "tumbling")


def _throw(contact="gated", duration=10.0, *changes):
    """The paper's throw, spinning. Upright it lands at 1.6 s or sooner, ungated a little later."""
    spin = "launch.angular_momentum=[0.3, 0.5, 0.2]"
    return scenes.changed({"duration": duration}, [f"ground.contact={contact}", spin, *changes])


def _listed(scene, model, steps, rise=0.0, turn=(0.0, 0.0, 0.0)):
    """Return the last state of the kernel in the listings' order; its launch `rise` [m] higher, turned by `turn`."""
    launch = dataclasses.replace(scene.launch, position=(0.0, 0.0, 3.0 + rise), orientation=turn)
    return fixed_step.prepare(dataclasses.replace(scene, launch=launch), model, "symplectic_euler", 1, steps)().states[
        -1
    ]


def _apart(one, other):
    """Return the largest difference of any number of two states, that of the nodes' spin apart from the others."""
    return max(np.abs(one[name] - other[name]).max() for name in STATE.names)


@pytest.mark.parametrize("contact", ["gated", "ungated"])
@pytest.mark.parametrize("model", MODELS)
def test_it_agrees_with_the_listings_order_to_1e_12_until_the_first_touch_down(model, contact):
    scene = _throw(contact, 1.2)
    assert _apart(swift.prepare(scene, model, 12_000)()[0], _listed(scene, model, 12_000)) < 1e-12


@pytest.mark.parametrize("contact", ["gated", "ungated"])
@pytest.mark.parametrize("model", MODELS)
def test_after_it_the_two_part_no_faster_than_launches_that_differ_by_as_little(model, contact):
    """Bounces amplify any difference. So: the listings' order, launched off by what the two are at 1.2 s."""
    scene = _throw(contact, 5.0)
    early = dataclasses.replace(scene, duration=1.2)
    off = 1e-15 + _apart(swift.prepare(early, model, 12_000)()[0], _listed(early, model, 12_000))
    listed = _listed(scene, model, 50_000)
    nudges = [{"rise": sign * off} for sign in (-1, 1)]
    nudges += [{"turn": tuple(row)} for row in off * np.vstack([np.eye(3), -np.eye(3)])]
    nudged = max(_apart(listed, _listed(scene, model, 50_000, **nudge)) for nudge in nudges)
    assert _apart(swift.prepare(scene, model, 50_000)()[0], listed) < 4 * nudged


@pytest.mark.parametrize(
    "changes",
    [
        ["ground.normal=[0.2, -0.3, 0.933]"],
        ["cube.geometry=exact", "cube.inertia=corners", "cube.mass=0.3", "cube.radius=0.4"],
        ["launch.node_velocity=rigid", "launch.orientation=[0.4, -0.2, 0.9]", "ground.friction=1"],
        ["gravity=0", "launch.velocity=[3, 1, -4]"],
    ],
    ids=["slope", "cube", "launch", "weightless"],
)
def test_one_step_is_the_listings_step_anywhere_on_the_way(changes):
    """Step by step from states in the air, on a corner and in between: no difference has time to grow."""
    scene = _throw("gated", 4.0, "ground.damping=0.3", *changes)
    path = simulate(scene, model="tumbling", steps=4000, every=1).trajectory.state
    assert (np.diff(path["angular_momentum"], axis=0) != 0).any()  # it does touch the ground
    advanced = path[:-1].copy()
    _advance(scene, advanced, 1)
    for name in STATE.names:
        size = np.abs(path[name]).max()
        np.testing.assert_allclose(advanced[name], path[name][1:], rtol=0, atol=2e-14 * size)


def _advance(scene, states, steps):
    from stiffdice.dynamics.contact import LAWS
    from stiffdice.dynamics.models.registry import MODELS as TAGS
    from stiffdice.dynamics.state import physics_of

    swift.advance(TAGS["tumbling"], LAWS["gated"], physics_of(scene), states, 1e-3, steps)


def test_a_spin_of_any_rate_turns_the_cube_as_rodrigues_says():
    """The series below a quarter of a radian a step and the functions above it: the nodes stay at their distance."""
    for spin in (1e-9, 0.05, 3.0, 240.0, 2600.0, 40_000.0):
        scene = _throw("gated", 0.1, f"launch.angular_momentum=[{spin / 7}, {spin / 5}, {-spin / 9}]")
        assert _apart(swift.prepare(scene, "tumbling", 100)()[0], _listed(scene, "tumbling", 100)) < 1e-13 * (1 + spin)


def test_a_run_that_blows_up_ends_out_of_range_and_nothing_is_raised():
    scene = _throw("gated", 10.0, "ground.stiffness=1e300", "cube.mass=1e-20")
    assert not np.isfinite(swift.prepare(scene, "tumbling", 2000)()[0]["position"]).all()


@pytest.mark.parametrize("contact", ["gated", "ungated"])
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("omega_h", [0.2, 1.3])
def test_a_sweep_sees_what_a_run_sees_that_is_watched_at_every_step(model, contact, omega_h):
    """Touch-downs, lift-offs, apexes, restitutions, the largest energy in the air, and the step that decides."""
    scene = _throw(contact, 1.9 if model == "tumbling" else 3.2, "ground.stiffness=1e5")
    steps = int(scene.duration * np.sqrt(4e5) / omega_h)
    members = phased(scene, model, steps, 8, turned(scene, model, 8))
    asked = {name: 0.01 for name in ("energy", "apex", "restitution") if name in criteria_of(model)}
    for stop in (None, asked):
        fast, watched = (
            simulate(scene, model=model, steps=steps, members=members, criteria=asked, stop=stop, leap=leap)
            for leap in (None, False)
        )
        assert fast.steps_computed.sum() < watched.steps_computed.sum() or contact == "ungated"
        np.testing.assert_array_equal(fast.verdict, watched.verdict)
        np.testing.assert_allclose(fast.touchdown_phase, watched.touchdown_phase, atol=1e-7)
        for k, name in enumerate(CRITERIA):
            if name in asked:
                np.testing.assert_array_equal(fast.decided[:, k], watched.decided[:, k])
                measure = CRITERIA[name].MEASURE
                np.testing.assert_allclose(fast.measures[measure], watched.measures[measure], atol=1e-7)


def test_where_a_step_changes_nothing_the_others_are_not_taken():
    """A cube that stands where its weight and its springs are equal, to the last bit."""
    scene = scenes.changed(
        {"duration": 100.0, "gravity": 8.0},
        [
            "ground.contact=gated",
            "ground.stiffness=4096",
            "cube.geometry=exact",
            "cube.radius=0.8660254037844386",
            "launch.position=[0, 0, 0.49951171875]",
            "launch.velocity=[0, 0, 0]",
            "launch.angular_momentum=[0, 0, 0]",
        ],
    )
    run = simulate(scene, model="tumbling", steps=10_000_000)
    assert run.steps_done[0] == 10_000_000
    assert run.steps_computed[0] < 100
    np.testing.assert_array_equal(run.end["position"][0], scene.launch.position)


def test_a_cube_that_comes_to_rest_on_the_way_is_left_where_it_rests():
    """To the last bit, after some dozen steps that nobody looks at; the state told is the one it rests in."""
    scene = scenes.changed(
        {"duration": 100.0},
        [
            *("ground.contact=gated", "ground.stiffness=1000", "ground.damping=20", "ground.friction=0"),
            *("launch.position=[0, 0, 0.514]", "launch.velocity=[0, 0, 0]", "launch.angular_momentum=[0, 0, 0]"),
        ],
    )
    fast, stepped = (simulate(scene, model="tumbling", steps=10_000, leap=leap) for leap in (None, False))
    assert fast.steps_done[0] == 10_000
    assert fast.steps_computed[0] < 200
    for name in STATE.names:
        np.testing.assert_allclose(fast.end[name], stepped.end[name], rtol=0, atol=1e-15)


def test_the_paper_s_scheme_is_the_one_it_stands_for():
    assert schemes.symplectic_euler.stretch is swift.stretch


@pytest.mark.parametrize(("model", "steps", "told"), [("rolling", 10, "model = rolling"), ("sliding", 0, "steps = 0")])
def test_bad_input_is_named(model, steps, told):
    with pytest.raises(InputError, match=told):
        swift.prepare(_throw(), model, steps)
