from __future__ import annotations

import numpy as np
import pytest

from stiffdice.ensemble import phased
from stiffdice.measures import apex, energy
from stiffdice.scene import Scene, from_mapping
from stiffdice.simulate import simulate
from stiffdice.state import physics_of, start_of


def measured(name, steps=2000, model="sliding", **keys):
    scene = from_mapping(keys)
    return float(simulate(scene, model=model, steps=steps).measures[name][0])


GATED = {"contact": "gated", "friction": 0}


def test_a_flight_keeps_its_energy_to_what_the_scheme_makes_of_it():
    # Symplectic Euler keeps E − m g h w/2; with the same speed up and down, E itself comes back.
    assert measured("energy_ratio", ground=GATED, duration=1.0) == 1.0


def test_energy_ratio_is_the_largest_airborne_energy():
    scene = from_mapping({"ground": {"stiffness": 1e6}})
    run = simulate(scene, model="sliding", steps=10_000, every=1)
    kept = run.trajectory
    airborne = kept.elastic_energy == 0
    assert run.measures["energy_ratio"][0] == pytest.approx(
        kept.energy_paper[airborne].max() / kept.energy_paper[0], rel=1e-13
    )
    assert run.measures["energy_ratio"][0] == pytest.approx(1.7666, abs=1e-4)  # 96.1 J of 54.4 J, the paper's figure 10


def test_a_launch_from_inside_the_ground_is_measured_with_its_springs_energy():
    deep = {"position": [0, 0, 0.4], "velocity": [0, 0, 0]}
    ratio = measured("energy_ratio", 100_000, ground=GATED | {"damping": 0}, launch=deep)
    assert ratio == pytest.approx(1, abs=2e-3)


def test_energy_on_a_slope_is_counted_from_the_ground_below():
    """A thousand metres down the hill m g z is far below zero; what is left is still the launch's energy."""
    keys = {"ground": GATED | {"damping": 0, "normal": [1, 0, 1]}, "launch": {"velocity": [0, 0, 0]}}
    assert measured("energy_ratio", 200_000, **keys) == pytest.approx(1, abs=1e-2)


def test_apex_ratio_is_exact_between_the_steps():
    """Two flights, of heights known from the exact restitution of an undamped bounce at a magic step: equal."""
    omega_h = 2 * np.sin(np.pi / 12)
    duration = 4.0
    steps = round(duration * np.sqrt(4e4) / omega_h)
    keys = {"ground": GATED | {"damping": 0, "stiffness": 1e4}, "duration": duration}
    assert measured("apex_ratio", steps, **keys) == pytest.approx(1, abs=2e-2)
    assert measured("apex_ratio", steps * 50, **keys) == pytest.approx(1, abs=1e-3)


def test_apex_ratio_compares_each_flight_with_the_one_before():
    scene = from_mapping({"ground": {"stiffness": 1e6}})
    run = simulate(scene, model="sliding", steps=10_000, every=1)
    z = run.trajectory.state["position"][:, 2]
    apexes = z[1:-1][(z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])]
    assert run.measures["apex_ratio"][0] == pytest.approx((apexes[1:] / apexes[:-1]).max(), rel=1e-4)


def test_a_flight_that_never_tops_out_counts_with_the_top_it_is_bound_for():
    """At ωh = 6.3 the first bounce throws the cube so high that it is still rising at the end."""
    scene = from_mapping({"ground": {"stiffness": 1e7}})
    run = simulate(scene, model="sliding", steps=10_000, every=1)
    kept = run.trajectory
    z, w = kept.state["position"][-1, 2], kept.state["velocity"][-1, 2]
    assert w > 0
    first = kept.state["position"][:1500, 2].max()
    assert run.measures["apex_ratio"][0] == pytest.approx((z + w**2 / 19.6) / first, rel=1e-3)
    assert run.measures["apex_ratio"][0] > 100


def test_a_launch_pressed_into_the_ground_may_rise_by_what_its_springs_hold():
    pressed = {"position": [0, 0, 0.5], "velocity": [0, 0, 0]}
    assert measured("apex_ratio", 200_000, ground=GATED | {"damping": 0}, launch=pressed) == pytest.approx(1, abs=2e-3)


@pytest.mark.parametrize("velocity", [[0, 0, -10], [0, 0, 0], [0, 0, 5]])
@pytest.mark.parametrize("steps", [60, 100, 1000])
def test_coarse_steps_make_no_apex_rise_by_themselves(velocity, steps):
    """A flight is measured against the same scheme's flight from the launch, at a magic step: no bounce gains."""
    omega_h = 1.0
    duration = 4.0
    stiffness = (omega_h * steps / duration) ** 2 / 4
    launch = {"position": [0, 0, 30], "velocity": velocity}
    keys = {"ground": GATED | {"damping": 0, "stiffness": stiffness}, "launch": launch, "duration": duration}
    assert measured("apex_ratio", steps, **keys) <= 1.02


def test_no_flight_no_apex():
    lying = {"position": [0, 0, 0.5], "velocity": [0, 0, 0]}
    assert measured("apex_ratio", ground=GATED | {"damping": 10, "stiffness": 100}, launch=lying) == 0


@pytest.mark.parametrize("contact", ["ungated", "gated"])
@pytest.mark.parametrize("steps", [700, 7_777, 60_000])
def test_members_touch_down_at_evenly_spread_phases(contact, steps):
    scene = Scene().with_ground(contact=contact)
    count = 16
    run = simulate(scene, model="sliding", steps=steps, members=phased(scene, "sliding", steps, count))
    phase = np.sort(run.measures["touchdown_phase"])
    gaps = np.diff(np.append(phase, phase[0] + 1))
    np.testing.assert_allclose(gaps, 1 / count, rtol=0.2)


@pytest.mark.parametrize("offset", [0.0, 0.1, 0.25, 0.37, 0.5])
def test_an_apex_between_coarse_steps_is_the_parabolas(offset):
    """Two flights of known tops, sampled at six steps each, with a step on the ground between them."""
    scene = from_mapping({"gravity": 10.0, "launch": {"position": [0, 0, 2], "velocity": [0, 0, 0]}})
    h = 0.1
    t = (np.arange(6) - 2.5 - offset) * h
    first, second = 4.0 - 5 * t**2, 5.0 - 5 * t**2
    memory = np.zeros(apex.SLOTS)
    apex.start(memory, physics_of(scene), start_of(scene, "sliding")[0], first[0], 1.0, h)
    for height, clearance in [(z, 1.0) for z in first[1:]] + [(0.5, -0.1)] + [(z, 1.0) for z in second]:
        apex.observe(memory, height, clearance)
    assert float(apex.value(memory)) == pytest.approx(5 / 4, rel=1e-14)


def test_a_swing_within_the_ground_is_no_flight():
    memory = np.zeros(apex.SLOTS)
    scene = from_mapping({"launch": {"position": [0, 0, 0.4], "velocity": [0, 0, 0]}})
    apex.start(memory, physics_of(scene), start_of(scene, "sliding")[0], 0.4, -0.1, 0.1)
    for height in (0.45, 0.5, 0.45, 0.4, 9.0, 0.4):
        apex.observe(memory, height, -0.1)
    assert apex.value(memory) == 0


def test_the_launch_counts_with_the_top_that_its_steps_reach():
    """From one step of a parabola under g its top is known exactly, whatever the scheme."""
    before, now, h = 3.0 - 5 * 0.25**2, 3.0 - 5 * 0.15**2, 0.1
    assert apex._bound_for.py_func(before, now, 10.0, h) == pytest.approx(3.0, rel=1e-14)


def test_energy_counts_rotation_and_only_the_air():
    scene = from_mapping({"ground": {"damping": 0.1, "friction": 0.3}, "launch": {"angular_momentum": [0.5, 1, 0.2]}})
    run = simulate(scene, model="tumbling", steps=20_000, every=1)
    kept = run.trajectory
    energy_at_launch = kept.energy_paper[0]
    assert kept.kinetic_energy[0] > 25 + 0.5 * 1.29 / scene.cube.moment_of_inertia - 1e-9
    airborne = kept.elastic_energy == 0
    expected = kept.energy_paper[airborne].max() / energy_at_launch
    assert run.measures["energy_ratio"][0] == pytest.approx(expected, rel=1e-13)
    memory = np.zeros(energy.SLOTS)
    energy.start(memory, physics_of(scene), start_of(scene, "tumbling")[0], 3.0, 1.0)
    fast = kept.state[:1].copy()
    fast["velocity"] *= 10
    energy.observe(memory, physics_of(scene), fast[0], -0.1)
    assert energy.value(memory) == 1
    energy.observe(memory, physics_of(scene), fast[0], 0.1)
    assert energy.value(memory) > 40


def test_no_touch_down_no_phase():
    assert np.isnan(measured("touchdown_phase", duration=0.5))


@pytest.mark.parametrize("z", [1.0, 2.0, 3.0])
def test_phase_is_exact_at_the_coarsest_steps(z):
    keys = {"ground": GATED, "launch": {"position": [0, 0, z], "velocity": [0, 0, 0]}}
    lowest = z - 1.0352761804100830 / 2 - 9.8 * np.array([0, 1, 3, 6, 10])  # h = 1 s
    first = np.flatnonzero(lowest <= 0)[0]
    expected = lowest[first - 1] / (lowest[first - 1] - lowest[first])
    assert measured("touchdown_phase", 10, **keys) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_phase_is_where_the_lowest_node_crosses_the_ground(model):
    scene = from_mapping({"ground": GATED, "launch": {"orientation": [0.3, 0.2, 0.1]}})
    run = simulate(scene, model=model, steps=5000, every=1)
    state = run.trajectory.state
    lowest = (state["position"][:, None, 2] + state["node_offset"][:, :, 2]).min(axis=1)
    first = np.flatnonzero(lowest <= 0)[0]
    phase = lowest[first - 1] / (lowest[first - 1] - lowest[first])
    assert run.measures["touchdown_phase"][0] == pytest.approx(phase, abs=1e-9)
