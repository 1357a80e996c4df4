from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiffdice.dynamics.state import STATE, Ensemble, start_of
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.criteria.trajectory import SAMPLES, distance, empty
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.reference_run import references
from stiffdice.simulation.run import simulate

SCENE = from_mapping({"ground": {"contact": "gated", "friction": 0.3}, "duration": 4.0})
HORIZON = 2.5  # after the first bounce, before the second


@pytest.fixture(scope="module")
def compared():
    """What the base scene is compared with, and how far off that is [m]."""
    return references(SCENE, "sliding", start_of(SCENE, "sliding"), HORIZON)


def errors(compared, steps, scene=SCENE, **options):
    return simulate(scene, model="sliding", steps=steps, references=compared[0], **options).measures["trajectory_error"]


def test_it_is_not_a_number_where_it_is_not_asked():
    run = simulate(SCENE, model="sliding", steps=1000)
    assert np.isnan(run.measures["trajectory_error"][0])
    assert run.decided[0].tolist() == [0, 0, 0, 0, 0]


def test_it_is_the_largest_distance_before_the_horizon_in_radii(compared):
    """Against the truth itself at the times of a coarse run."""
    steps = 5000
    kept = simulate(SCENE, model="sliding", steps=steps, every=1).trajectory
    truth = simulate(SCENE, model="sliding", scheme="event", steps=steps, every=1).trajectory
    inside = kept.time <= HORIZON
    distance = np.linalg.norm(kept.state["position"] - truth.state["position"], axis=1)
    assert distance[inside].max() < distance.max()  # the horizon cuts the worst off
    assert errors(compared, steps, every=1)[0] == pytest.approx(distance[inside].max(), abs=1e-7)


def test_it_falls_with_the_step_as_the_schemes_order():
    """Half the step, half the error: the worst of all phases of the bounce, which a single run's luck is not."""
    soft = SCENE.with_ground(stiffness=1e2)
    compared = references(soft, "sliding", start_of(soft, "sliding"), HORIZON)
    found = [
        errors(compared, steps, soft, members=phased(soft, "sliding", steps, 16)).max() for steps in (2000, 4000, 8000)
    ]
    np.testing.assert_allclose(np.log2(found[:-1]) - np.log2(found[1:]), 1, atol=0.05)


def test_distances_are_in_radii_of_the_cube():
    """A scene ten times as large in a tenth of the gravity's rate moves alike; its error in radii is the same."""
    found = []
    for scale in (1.0, 10.0):
        launch = {"position": [0, 0, 3 * scale], "velocity": [5 * scale, 0, 5 * scale]}
        cube = {"radius": scale, "geometry": "exact"}
        ground = {"contact": "gated", "friction": 0}
        scene = from_mapping(
            {"cube": cube, "ground": ground, "launch": launch, "gravity": 9.8 * scale, "duration": 2.0}
        )
        compared, _ = references(scene, "sliding", start_of(scene, "sliding"), 2.0)
        found.append(errors((compared, 0), 3000, scene)[0])
    assert found[0] == pytest.approx(found[1], rel=1e-6)


@pytest.mark.parametrize("every", [None, 1])
def test_it_is_settled_at_the_first_step_past_the_horizon(compared, every):
    """Whether or not it was asked to end the run, and whether or not the flight there is skipped."""
    steps = 4096  # h = 2^-10 s
    run = simulate(SCENE, model="sliding", steps=steps, references=compared[0], every=every)
    settled = run.decided[0, 4]
    assert settled >= 2561
    assert settled <= 2561 + (0 if every else 1 + 1 + HORIZON / 2048 * 1024)
    assert run.steps_done[0] == steps


def test_a_run_stops_once_it_is_past_the_horizon(compared):
    stop = {"trajectory": 1.0}
    run = simulate(SCENE, model="sliding", steps=4096, references=compared[0], stop=stop, criteria=stop)
    assert 2561 <= run.steps_done[0] == run.decided[0, 4] < 2570
    assert run.measures["trajectory_error"][0] <= 1
    assert run.verdict[0] == 0


def test_skipping_a_flight_hides_no_distance(compared):
    """A flight is looked at no less often than its reference is known: the error at a coarse launch is seen there."""
    for steps in (3000, 100_000):
        (stepped,), (skipped,) = errors(compared, steps, every=1), errors(compared, steps)
        assert skipped <= stepped + 1e-9
        assert skipped == pytest.approx(stepped, rel=1e-2)


def test_members_are_compared_at_the_time_since_the_scenes_launch(compared):
    """Each enters the same flight late: compared at its own time it would be off by speed times delay."""
    steps = 2000
    members = phased(SCENE, "sliding", steps, 8)
    shorter = dataclasses.replace(SCENE, duration=1.0)
    found = errors(compared, steps // 4, shorter, members=members)
    np.testing.assert_allclose(found, 9.8 * (4 / steps) * 1.0 / 2, rtol=0.01)  # g h t/2, the scheme's own


def test_an_ensemble_is_as_far_off_as_the_scenes_own_launch(compared):
    """After a bounce, too, by which time the phases differ."""
    steps = 20_000
    found = errors(compared, steps, members=phased(SCENE, "sliding", steps, 16))
    assert 0.1 * found[0] < found.min() <= found.max() < 10 * found[0]


def test_each_member_may_have_its_own_reference():
    """Of launches that differ, each is compared with its own; the scene's for all would be far off."""
    scene = from_mapping(
        {"ground": {"contact": "gated"}, "launch": {"angular_momentum": [0.2, 0.1, 0.3]}, "duration": 2.0}
    )
    launches = turned(scene, "tumbling", 3)
    launches["position"][:, 0] += [0, 1, 2]
    own, _ = references(scene, "tumbling", launches, 1.8)
    members = Ensemble(launches, np.zeros(3))
    run = simulate(scene, model="tumbling", steps=100_000, members=members, references=own)
    assert (run.measures["trajectory_error"] < 0.02).all()
    shared = simulate(scene, model="tumbling", steps=100_000, members=members, references=own[:1])
    assert (shared.measures["trajectory_error"][1:] >= [1, 2]).all()


number = st.floats(-100, 100)
vector = st.tuples(number, number, number).map(np.array)


def polynomial(coefficients, horizon):
    """A reference that moves along a polynomial of time, coefficients shape (power, axis), and the path itself."""
    coefficients = np.array(coefficients)
    powers = np.arange(len(coefficients))[:, None]

    def path(t):
        return (coefficients * t**powers).sum(axis=0)

    def velocity(t):
        return (powers[1:] * coefficients[1:] * t ** (powers[1:] - 1)).sum(axis=0)

    times = np.linspace(0, horizon, SAMPLES + 1)
    reference = empty(1, horizon)
    reference["position"], reference["velocity"] = ([curve(t) for t in times] for curve in (path, velocity))
    return reference[0], path


def at(place):
    state = np.zeros(1, STATE)
    state["position"] = place
    return state[0]


@given(vector, vector, vector, st.floats(0.1, 10), st.floats(0, 1))
@pytest.mark.long
def test_a_parabola_is_interpolated_exactly(start, speed, pull, horizon, moment):
    reference, path = polynomial([start, speed, pull], horizon)
    t = moment * horizon
    assert distance(reference, t, at(path(t))) < 1e-12 * (1 + np.abs([start, speed, pull]).max() * (1 + horizon) ** 2)


def test_a_cubic_too_but_no_quartic():
    t = 0.5 * 2 / SAMPLES  # halfway between two samples
    cubic, path = polynomial(np.ones((4, 3)), 2.0)
    assert distance(cubic, t, at(path(t))) < 1e-14
    quartic, path = polynomial(np.ones((5, 3)), 2.0)
    # The error of Hermite's cubic: f''''/4! · (s/2)⁴, in each of three axes.
    assert distance(quartic, t, at(path(t))) == pytest.approx(np.sqrt(3) * (1 / SAMPLES) ** 4, rel=1e-2)


@pytest.mark.parametrize("t", [0.0, 0.3, 2.0])
def test_distance_is_euclids(t):
    reference, path = polynomial([[1, 2, 3], [4, 5, 6]], 2.0)
    assert distance(reference, t, at(np.add(path(t), [3, 4, 12]))) == pytest.approx(13, rel=1e-14)


def test_none_is_compared_with_nothing():
    assert empty().shape == (1,)
    assert empty()["horizon"][0] < 0
