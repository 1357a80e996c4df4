"""Free flight in one step is free flight step by step: the same touch-downs at the same steps, and less work."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.initial_conditions import phased
from stiffdice.simulation.run import simulate

SCENES = {
    "sliding": ("sliding", {}),
    "sliding, undamped": ("sliding", {"ground": {"damping": 0, "friction": 0}}),
    "tumbling": ("tumbling", {"launch": {"angular_momentum": [0.3, 0.5, -0.2]}}),
    "tumbling, rigid start": ("tumbling", {"launch": {"angular_momentum": [0.3, 0, 0], "node_velocity": "rigid"}}),
    "a slope": ("sliding", {"ground": {"normal": [0.4, 0.1, 1]}}),
    "a slope, tumbling": ("tumbling", {"ground": {"normal": [0.4, 0.1, 1]}, "launch": {"angular_momentum": [0, 1, 0]}}),
    "a wall": ("sliding", {"ground": {"normal": [1, 0, 0]}, "launch": {"position": [8, 0, 3], "velocity": [-9, 1, 2]}}),
    "a ceiling": (
        "sliding",
        {"ground": {"normal": [0, 0, -1]}, "launch": {"position": [0, 0, -9], "velocity": [0, 0, 12]}},
    ),
    "launched down": ("sliding", {"launch": {"velocity": [3, 1, -6]}}),
    "launched at rest": ("sliding", {"launch": {"velocity": [0, 0, 0]}}),
    "no gravity": ("tumbling", {"gravity": 0, "launch": {"velocity": [0, 0, -4], "angular_momentum": [0.2, 0.1, 0]}}),
    "small and light": ("tumbling", {"cube": {"radius": 0.01, "mass": 0.004, "geometry": "exact"}}),
}


def pair(keys, model, steps, contact, duration):
    """The same run, skipping and not: `every` = steps keeps two samples, and steps everything between."""
    ground = {"contact": contact} | keys.get("ground", {})
    scene = from_mapping(keys | {"ground": ground, "duration": duration})
    return tuple(simulate(scene, model=model, steps=steps, every=every) for every in (None, steps))


def compare(skipping, stepping, tolerance):
    assert skipping.steps_done[0] == stepping.steps_done[0]
    assert stepping.steps_computed[0] == stepping.steps
    for name in skipping.end.dtype.names:
        size = np.abs(stepping.end[name]).max() + 0.1  # round-off is that of the forces, also where they cancel
        np.testing.assert_allclose(skipping.end[name], stepping.end[name], rtol=0, atol=tolerance * size, err_msg=name)
    for name, measure in stepping.measures.items():
        np.testing.assert_allclose(skipping.measures[name], measure, rtol=tolerance, atol=tolerance, err_msg=name)
    np.testing.assert_allclose(skipping.touchdown_phase, stepping.touchdown_phase, rtol=0, atol=1e-7)


@pytest.mark.parametrize("steps", [400, 5_000, 100_000])
@pytest.mark.parametrize("name", SCENES)
def test_gated_flights_are_skipped_to_round_off(name, steps):
    model, keys = SCENES[name]
    skipping, stepping = pair(keys, model, steps, "gated", duration=2.5)
    compare(skipping, stepping, 1e-7)
    if steps > 400:  # towards a ceiling, which gravity pulls away from, nothing is skipped
        assert skipping.steps_computed[0] < steps * (0.6 if name == "a ceiling" else 0.33)


@pytest.mark.parametrize("steps", [400, 5_000, 100_000])
@pytest.mark.parametrize("name", [name for name, (model, _) in SCENES.items() if model == "sliding"])
def test_the_listings_law_lets_only_what_rises_fly(name, steps):
    """It drags on what falls; a cube that rises, away from the ground, feels nothing of it."""
    model, keys = SCENES[name]
    skipping, stepping = pair(keys, model, steps, "ungated", duration=2.5)
    compare(skipping, stepping, 1e-7)
    if name == "sliding" and steps > 400:
        assert 0.3 < skipping.steps_computed[0] / steps < 0.8


@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_the_listings_law_lets_no_node_fly_that_may_turn_downwards(contact):
    model, keys = SCENES["tumbling"]
    skipping, stepping = pair(keys, model, 3000, contact, duration=2.5)
    if contact == "ungated":
        assert skipping.steps_computed[0] == 3000
        compare(skipping, stepping, 1e-10)
    else:
        assert skipping.steps_computed[0] < 1000


def test_a_long_flight_costs_next_to_nothing():
    up = {"launch": {"position": [0, 0, 3], "velocity": [0, 0, 40]}}
    skipping, stepping = pair(up, "sliding", 1_000_000, "gated", duration=8.0)
    assert skipping.steps_computed[0] < 100
    compare(skipping, stepping, 1e-8)


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_touch_down_is_at_the_same_step(model, contact):
    """Asked of a run that ends there: one step less and neither touches, one more and both have."""
    scene = from_mapping(
        {"ground": {"contact": contact}, "launch": {"angular_momentum": [0.3, 0.5, 0.1]}, "duration": 4.0}
    )
    steps = 4096
    kept = simulate(scene, model=model, steps=steps, every=1).trajectory.state
    lowest = (kept["position"][:, None, 2] + kept["node_offset"][:, :, 2]).min(axis=1)
    first = int(np.flatnonzero(lowest <= 0)[0])
    for last, touched in ((first - 1, False), (first, True)):
        shorter = from_mapping(scene.as_mapping() | {"duration": last * 4.0 / steps})
        run = simulate(shorter, model=model, steps=last)
        assert np.isfinite(run.touchdown_phase[0]) == touched


def test_members_are_skipped_each_on_its_own():
    scene = from_mapping({"ground": {"contact": "gated"}, "duration": 2.0})
    members = phased(scene, "sliding", 3000, 5)
    together = simulate(scene, model="sliding", steps=3000, members=members)
    assert (together.steps_computed < 300).all()
    for k in range(5):
        only = members._replace(launches=members.launches[k : k + 1], late=members.late[k : k + 1])
        alone = simulate(scene, model="sliding", steps=3000, members=only)
        assert alone.end[0] == together.end[k]
        assert alone.steps_computed[0] == together.steps_computed[k]


speeds = st.tuples(st.floats(-8, 8), st.floats(-8, 8), st.floats(-8, 12)).map(list)
# Not by round-off: friction makes chatter out of a spin or a slope of 1e-16, and chatter out of every other bit.
spins = st.tuples(*[st.integers(-99, 99)] * 3).map(lambda spin: [part / 50 for part in spin])
tilts = st.tuples(st.integers(-99, 99), st.integers(-99, 99)).map(lambda tilt: [tilt[0] / 99, tilt[1] / 99, 1.0])


@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from(["sliding", "tumbling"]),
    st.sampled_from(["ungated", "gated"]),
    speeds,
    spins,
    tilts,
    st.floats(1.5, 6),
    st.integers(0, 20_000).map(lambda gravity: gravity / 1000),  # a weight of 1e-323 N has no digits
    st.integers(20, 3000),
)
@pytest.mark.long
def test_any_flight_and_its_first_contact(model, contact, velocity, spin, normal, height, gravity, steps):
    """Until a tenth of a second after the first touch-down: from then on round-off may grow."""
    launch = {"position": [0, 0, height * 1.5], "velocity": velocity, "angular_momentum": spin}
    keys = {"ground": {"normal": normal, "stiffness": 1e3, "contact": contact}, "launch": launch, "gravity": gravity}
    scene = from_mapping(keys | {"duration": 3.0})
    kept = simulate(scene, model=model, steps=steps, every=1).trajectory.state
    nodes = kept["position"][:, None] + kept["node_offset"]
    touching = np.flatnonzero((nodes @ np.array(scene.ground.normal)).min(axis=1) <= 0)
    until = min(steps, int(touching[0]) + 1 + steps // 30) if touching.size else steps
    shorter = from_mapping(scene.as_mapping() | {"duration": until * (3.0 / steps)})
    skipping, stepping = (simulate(shorter, model=model, steps=until, every=every) for every in (None, until))
    compare(skipping, stepping, 1e-8)


extremes = st.floats(-320, 308).map(lambda exponent: 10.0**exponent) | st.just(0.0)


@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from(["sliding", "tumbling"]),
    st.sampled_from(["ungated", "gated"]),
    extremes,
    extremes,
    extremes,
    extremes.filter(lambda duration: duration > 0),
    st.sampled_from([1.0, -1.0, 0.0]),
    extremes,
    st.integers(1, 300),
)
@pytest.mark.long
def test_no_scene_is_too_extreme_to_be_skipped(
    model, contact, gravity, stiffness, damping, duration, way, speed, steps
):
    keys = {
        "ground": {"stiffness": stiffness, "damping": damping, "contact": contact},
        "launch": {"velocity": [0, 0, way * speed], "angular_momentum": [0, speed, 0]},
        "gravity": gravity,
        "duration": duration,
    }
    run = simulate(from_mapping(keys), model=model, steps=steps)
    assert 0 <= run.steps_computed[0] <= run.steps_done[0] + 1
    assert run.steps_done[0] == steps or run.measures["out_of_range"][0] == 1
