from __future__ import annotations

import numpy as np
import pytest

from stiffdice.ensemble import phased
from stiffdice.scene import Scene, from_mapping
from stiffdice.simulate import simulate


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
