"""Flights, touch-downs and lift-offs as the tracker sees them, against what a stored trajectory says."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.state import physics_of
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation import monitor
from stiffdice.simulation.initial_conditions import phased
from stiffdice.simulation.monitor import SIGHT
from stiffdice.simulation.run import simulate

GATED = {"contact": "gated", "friction": 0}
HALF = 1.0352761804100830 / 2  # of the side


def sight_of(scene, state, h, late=0.0, lag=0.5):
    """Of a run that stands at its launch, shape (1,)."""
    sight = np.zeros(1, SIGHT)
    sight["step_size"], sight["late"], sight["lag"] = h, late, lag
    monitor.start(sight[0], physics_of(scene), state)
    return sight


def watched(scene, steps, model="sliding"):
    """What the tracker holds after each step, shape (steps + 1,), and the lowest node's height then [m]."""
    states = simulate(scene, model=model, steps=steps, every=1).trajectory.state
    physics, seen = physics_of(scene), np.zeros(steps + 1, SIGHT)
    sight = sight_of(scene, states[0], scene.duration / steps)
    seen[0] = sight[0]
    for k in range(1, steps + 1):
        monitor.observe(sight[0], physics, states[k], k, 0)
        seen[k] = sight[0]
    nodes = states["position"][:, None] + states["node_offset"]
    return seen, (nodes @ np.array(scene.ground.normal)).min(axis=1)


def phase_of(steps=2000, model="sliding", **keys):
    return float(simulate(from_mapping(keys), model=model, steps=steps).touchdown_phase[0])


def test_no_touch_down_no_phase():
    assert np.isnan(phase_of(duration=0.5))


@pytest.mark.parametrize("z", [1.0, 2.0, 3.0])
def test_phase_is_exact_at_the_coarsest_steps(z):
    keys = {"ground": GATED, "launch": {"position": [0, 0, z], "velocity": [0, 0, 0]}}
    lowest = z - HALF - 9.8 * np.array([0, 1, 3, 6, 10])  # h = 1 s
    first = np.flatnonzero(lowest <= 0)[0]
    expected = lowest[first - 1] / (lowest[first - 1] - lowest[first])
    assert phase_of(10, **keys) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("every", [None, 1])
@pytest.mark.parametrize("model", ["sliding", "tumbling"])
@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_phase_is_where_the_lowest_node_crosses_the_ground(model, contact, every):
    scene = from_mapping(
        {"ground": {"contact": contact}, "launch": {"orientation": [0.3, 0.2, 0.1], "angular_momentum": [1, 2, 0]}}
    )
    state = simulate(scene, model=model, steps=5000, every=1).trajectory.state
    lowest = (state["position"][:, None, 2] + state["node_offset"][:, :, 2]).min(axis=1)
    first = np.flatnonzero(lowest <= 0)[0]
    phase = lowest[first - 1] / (lowest[first - 1] - lowest[first])
    found = simulate(scene, model=model, steps=5000, every=every).touchdown_phase[0]
    assert found == pytest.approx(phase, abs=1e-9)


@pytest.mark.parametrize("contact", ["ungated", "gated"])
@pytest.mark.parametrize("steps", [700, 7_777, 60_000])
def test_members_touch_down_at_evenly_spread_phases(contact, steps):
    scene = Scene().with_ground(contact=contact)
    count = 16
    run = simulate(scene, model="sliding", steps=steps, members=phased(scene, "sliding", steps, count))
    phase = np.sort(run.touchdown_phase)
    gaps = np.diff(np.append(phase, phase[0] + 1))
    np.testing.assert_allclose(gaps, 1 / count, rtol=0.2)


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
@pytest.mark.parametrize("normal", [[0, 0, 1], [0.1, -0.2, 1]], ids=["flat", "slope"])
@pytest.mark.parametrize("steps", [500, 3000])
@pytest.mark.long
def test_clearance_is_exact_near_the_ground_and_never_too_much(model, normal, steps):
    """Which steps are in the air is known to the last bit; far up a lower bound will do."""
    ground = {"stiffness": 1e3, "contact": "gated", "normal": normal}
    scene = from_mapping({"ground": ground, "launch": {"angular_momentum": [0.2, 0.4, 0.1]}, "duration": 4.0})
    seen, lowest = watched(scene, steps, model)
    np.testing.assert_array_equal(seen["clearance"] > 0, lowest > 0)
    assert (seen["clearance"] <= lowest + 1e-12).all()
    # Exact in every step from which it touches down, and in the first of a flight.
    air = lowest > 0
    edge = (air & ~np.append(air[1:], True)) | (air & ~np.append(True, air[:-1]))
    np.testing.assert_allclose(seen["clearance"][edge], lowest[edge], rtol=0, atol=1e-12)
    assert (seen["clearance"] < lowest - 0.01).any()


@pytest.mark.long
def test_flights_are_counted_in_steps_and_bounces_in_flights():
    seen, lowest = watched(from_mapping({"ground": GATED}), 2000)
    air = (lowest > 0).tolist()
    streak, bounces = 2, 0
    for k in range(1, len(air)):
        streak = streak + 1 if air[k] else 0
        bounces += streak == 2 and k > 1
        assert seen["flight"][k] == streak
        assert seen["lifted"][k] == (streak == 2)
        assert seen["bounces"][k] == bounces
    assert bounces >= 4


@pytest.mark.parametrize("steps", [150, 1000, 20_000])
def test_speeds_at_the_ground_are_those_of_the_parabola_through_the_places(steps):
    """Between the steps, where no scheme has a speed: halfway it is (d − c)/h, g h²/8 above the middle of c and d."""
    scene = from_mapping({"ground": GATED | {"stiffness": 1e3}})
    seen, lowest = watched(scene, steps)
    h = scene.duration / steps
    speed = np.diff(lowest) / h
    level = np.sqrt(np.maximum(0, speed**2 + 2 * 9.8 * ((lowest[1:] + lowest[:-1]) / 2 + 9.8 * h * h / 8)))
    for k in np.flatnonzero(seen["lifted"]):
        assert seen["speed_out"][k] == pytest.approx(level[k - 1], rel=1e-9)
    flights = seen["flight"]
    touching = [k for k in range(1, steps + 1) if flights[k] == 0 and flights[k - 1] > 1]
    assert touching
    for k in touching:
        assert seen["speed_in"][k] == pytest.approx(level[k - 2], rel=1e-9)


@pytest.mark.parametrize("offset", [0.0, 0.1, 0.25, 0.37, 0.5])
def test_a_lift_off_between_coarse_steps_is_the_parabolas(offset):
    """A flight of known top, 5 m above touch-down, sampled at a few steps, by a scheme whose velocity lags."""
    g, h, top = 10.0, 0.1, 5.0
    scene = from_mapping(
        {"gravity": g, "ground": GATED, "launch": {"position": [0, 0, HALF - 0.1], "velocity": [0] * 3}}
    )
    physics = physics_of(scene)
    state = simulate(scene, model="sliding", steps=1, every=1).trajectory.state[:1].copy()
    sight = sight_of(scene, state[0], h)
    t = np.sqrt(2 * top / g)  # of the way up
    for k in range(3):
        late = (k + offset) * h + 1e-9  # since lift-off
        state["position"][0, 2] = HALF + top - g * (t - late) ** 2 / 2
        state["velocity"][0, 2] = g * (t - late + h / 2)
        monitor.observe(sight[0], physics, state[0], k + 1, 0)
    assert sight["speed_out"][0] == pytest.approx(np.sqrt(2 * g * top), rel=1e-12)


def test_time_is_counted_from_the_scenes_launch():
    physics, state = physics_of(Scene()), simulate(Scene(), model="sliding", steps=1, every=1).trajectory.state
    sight = sight_of(Scene(), state[0], 0.25, 0.1)
    assert sight["time"][0] == 0.1
    monitor.observe(sight[0], physics, state[1], 7, 5)
    assert sight["time"][0] == 0.1 + 7 * 0.25


def test_a_swing_within_the_ground_is_no_flight():
    rest = HALF - 9.8 / (4 * 1e3)
    scene = from_mapping(
        {"ground": GATED | {"stiffness": 1e3}, "launch": {"position": [0, 0, rest + 1e-3], "velocity": [0, 0, 0]}}
    )
    seen, lowest = watched(scene, 5000)
    assert (lowest < 0).all()
    assert not seen["flight"].any()
    assert not seen["bounces"].any()
    assert seen["sag"][0] == 9.8 / (4 * 1e3)


@pytest.mark.parametrize(
    ("keys", "sag", "pull"),
    [
        ({"gravity": 0}, 0, 0),
        ({"ground": {"stiffness": 0}}, 2 * 1.5**0.5 - 2**0.5, 9.8),  # the side: a cube sinks in no deeper
        ({"ground": {"normal": [0, 0, -1]}}, 0, -9.8),
        ({"ground": {"normal": [0, 3, 4], "stiffness": 2e3}, "cube": {"mass": 3}}, 3 * 9.8 * 0.8 / 8e3, 9.8 * 0.8),
    ],
)
def test_sag_and_pull_follow_the_normal(keys, sag, pull):
    scene = from_mapping(keys)
    state = simulate(scene, model="sliding", steps=1, every=1).trajectory.state
    sight = sight_of(scene, state[0], 0.1)
    assert sight["sag"][0] == pytest.approx(sag, rel=1e-14)
    assert sight["pull"][0] == pytest.approx(pull, rel=1e-14)
    assert monitor.settled(sight[0]) == pytest.approx(10 * pull * sag, rel=1e-14)
