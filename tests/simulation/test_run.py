from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiffdice.dynamics.state import Ensemble
from stiffdice.errors import InputError
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.initial_conditions import phased
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import default_every, simulate


def verdict(steps=1000, model="sliding", every=None, **keys):
    return Verdict(simulate(from_mapping(keys), model=model, steps=steps, every=every).verdict[0])


@pytest.mark.parametrize(("steps", "every"), [(10_000, 7), (999, 1), (3, 2), (1, 1), (70_000, 10_000)])
def test_time_is_a_fraction_of_the_duration_never_a_sum(steps, every):
    run = simulate(Scene(), model="sliding", steps=steps, every=every)
    kept = np.arange(0, steps + 1, every)
    np.testing.assert_array_equal(run.trajectory.step, kept)
    np.testing.assert_array_equal(run.trajectory.time, kept / steps * 10.0)
    np.testing.assert_array_equal(run.trajectory.state["position"][0], (0, 0, 3))


def test_samples_do_not_depend_on_how_many_are_kept():
    all_of_them = simulate(Scene(), model="tumbling", steps=5000, every=1).trajectory.state
    some = simulate(Scene(), model="tumbling", steps=5000, every=13).trajectory.state
    np.testing.assert_array_equal(all_of_them[::13], some)


def test_the_end_is_the_last_sample():
    run = simulate(Scene(), model="tumbling", steps=5000, every=1)
    np.testing.assert_array_equal(run.end[0], run.trajectory.state[-1])


@pytest.mark.parametrize("every", [None, 7])
def test_telling_progress_changes_nothing(every):
    told: list[float] = []
    quiet = simulate(Scene(), model="sliding", steps=1_000_000, every=every)
    loud = simulate(Scene(), model="sliding", steps=1_000_000, every=every, progress=told.append)
    np.testing.assert_array_equal(quiet.steps_computed, loud.steps_computed)
    np.testing.assert_array_equal(quiet.end, loud.end)
    for name, value in quiet.measures.items():
        np.testing.assert_array_equal(value, loud.measures[name])
    if every:
        np.testing.assert_array_equal(quiet.trajectory.state, loud.trajectory.state)
    assert told[-1] == 1
    assert len(told) > 1
    assert told == sorted(told)


def test_an_ensemble_is_its_members_one_by_one():
    scene = Scene().with_ground(stiffness=1e5, contact="gated")
    launches, late = phased(scene, "sliding", 3000, 5)
    together = simulate(scene, model="sliding", steps=3000, members=Ensemble(launches, late))
    for k in range(5):
        one = Ensemble(launches[k : k + 1], late[k : k + 1])
        alone = simulate(scene, model="sliding", steps=3000, members=one)
        assert alone.end[0] == together.end[k]
        for name, value in together.measures.items():
            np.testing.assert_array_equal(alone.measures[name], value[k : k + 1], err_msg=name)


def test_the_members_given_are_left_as_they_are():
    members = phased(Scene(), "sliding", 100, 3)
    before = members.launches.copy(), members.late.copy()
    simulate(Scene(), model="tumbling", steps=100, members=members)
    np.testing.assert_array_equal(members.launches, before[0])
    np.testing.assert_array_equal(members.late, before[1])


def test_an_ensemble_has_one_of_everything_for_each_member():
    run = simulate(Scene(), model="sliding", steps=100, members=phased(Scene(), "sliding", 100, 3))
    for values in (run.touchdown_phase, run.steps_done, run.steps_computed, run.verdict, *run.measures.values()):
        assert values.shape == (3,)
    assert run.decided.shape == (3, len(CRITERIA))
    assert list(run.measures) == [part.MEASURE for part in CRITERIA.values()]


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_no_ground_to_speak_of(model, contact):
    assert verdict(model=model, ground={"stiffness": 0, "contact": contact}) == Verdict.SANK


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_far_too_stiff_a_ground_is_a_run_that_blew_up(model, contact):
    assert verdict(10, model, ground={"stiffness": 1e16, "contact": contact}) == Verdict.BLEW_UP


def test_numbers_past_doubles_end_the_run_where_it_happens():
    scene = from_mapping({"ground": {"stiffness": 1e308, "contact": "gated"}, "cube": {"mass": 1e-9}})
    run = simulate(scene, model="sliding", steps=100, every=1)
    assert Verdict(run.verdict[0]) == Verdict.LEFT_NUMERIC_RANGE
    assert 0 < run.steps_done[0] < 100
    assert len(run.trajectory.time) == run.steps_done[0] + 1
    assert np.isfinite(run.trajectory.state["position"]).all()


def test_a_spin_past_doubles_is_noticed():
    keys = {
        "cube": {"radius": 1e-10, "geometry": "exact"},
        "ground": {"contact": "gated"},
        "launch": {"position": [0, 0, 1e5], "angular_momentum": [1e140, 0, 0]},
    }
    assert verdict(model="tumbling", **keys) == Verdict.LEFT_NUMERIC_RANGE


@pytest.mark.parametrize("gravity", [0.0, 1e300, 1e308])
def test_extreme_gravity_is_no_warning(gravity):
    simulate(from_mapping({"gravity": gravity}), model="sliding", steps=100, every=1)


def test_a_soft_landing_passes():
    assert verdict(10_000) == Verdict.PASSED


def test_the_papers_case_of_trouble_and_its_cure():
    stiff = {"ground": {"stiffness": 1e6}}
    assert verdict(10_000, **stiff) == Verdict.ENERGY_GREW
    assert verdict(20_000, **stiff) == Verdict.PASSED


def test_a_tumbling_cube_may_rise_higher_than_before():
    """Spin turns into height: an apex above the one before says nothing of the scheme there."""
    keys = {"ground": {"damping": 0.1, "friction": 0.1}, "launch": {"angular_momentum": [0.3, 0.5, 0.2]}}
    run = simulate(from_mapping(keys), model="tumbling", steps=100_000)
    assert run.measures["apex_ratio"][0] > 1.02
    assert Verdict(run.verdict[0]) == Verdict.PASSED


def test_a_verdict_asks_the_criteria_it_is_given():
    stiff = from_mapping({"ground": {"stiffness": 1e6, "contact": "gated"}})

    def ended(criteria):
        return Verdict(simulate(stiff, model="sliding", steps=13_000, criteria=criteria).verdict[0])

    assert ended(None) == Verdict.ENERGY_GREW
    assert ended({"energy": 2.0}) == Verdict.PASSED
    assert ended({"energy": 2.0, "apex": 0.02}) == Verdict.APEX_ROSE
    assert ended({"energy": 2.0, "restitution": 0.05}) == Verdict.RESTITUTION_OFF
    assert ended({}) == Verdict.PASSED


def test_a_step_too_short_for_doubles_is_told():
    """At 10²⁰ m from the origin the next place that a double knows is 16 km away."""
    far = {"launch": {"position": [1e20, 0, 1e20], "velocity": [5, 0, 5]}, "ground": {"contact": "gated"}}
    assert verdict(every=None, **far) == Verdict.STALLED
    assert verdict(launch={"position": [0, 0, 3], "velocity": [0, 0, 0]}, gravity=0) == Verdict.PASSED
    still = {"position": [0, 0, 3], "velocity": [0, 0, 0]}
    assert verdict(launch=still, gravity=1e-12, duration=1.0) == Verdict.PASSED


@pytest.mark.parametrize("every", [None, 1])
def test_a_run_that_needs_more_steps_than_its_budget_is_undecided(every):
    scene = Scene().with_ground(contact="gated")
    whole = simulate(scene, model="sliding", steps=10_000, every=every)
    needed = int(whole.steps_computed[0])
    enough = simulate(scene, model="sliding", steps=10_000, every=every, budget=needed)
    np.testing.assert_array_equal(enough.end, whole.end)
    assert Verdict(enough.verdict[0]) == Verdict.PASSED
    short = simulate(scene, model="sliding", steps=10_000, every=every, budget=needed // 2)
    assert Verdict(short.verdict[0]) == Verdict.UNDECIDED
    assert short.steps_computed[0] == needed // 2
    assert short.steps_done[0] < 10_000
    if every:
        assert len(short.trajectory.time) == needed // 2 + 1


@pytest.mark.parametrize("steps", [0, -1, 1.5, float("nan"), "many", None, True, 2**53 + 2])
def test_steps_are_a_whole_number(steps):
    with pytest.raises(InputError, match=r"steps = .*allowed is a whole number from 1 to 9007199254740992"):
        simulate(Scene(), steps=steps)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"model": "falling"}, "model = falling: allowed is vertical or sliding or tumbling or flying or auto"),
        ({"scheme": "magic"}, "scheme = magic: allowed is symplectic_euler"),
        ({"every": 0}, "every = 0"),
        ({"every": 101}, "every = 101: allowed is a whole number from 1 to 100"),
        ({"criteria": {"beauty": 1}}, "criteria.beauty: unknown; allowed are finite, energy"),
        ({"steps": 10**9, "every": 1}, r"would keep 1000000001 samples .* allowed is 200 or more"),
    ],
)
def test_bad_choices_are_named(keys, told):
    with pytest.raises(InputError, match=told):
        simulate(Scene(), **{"steps": 100} | keys)


def test_an_ensemble_keeps_no_trajectory():
    with pytest.raises(InputError, match="not of an ensemble"):
        simulate(Scene(), steps=100, every=1, members=phased(Scene(), "sliding", 100, 2))


@pytest.mark.parametrize(("steps", "every"), [(1, 1), (10_000, 1), (10_001, 2), (100_000, 10), (10**9, 100_000)])
def test_the_default_keeps_at_most_ten_thousand_samples(steps, every):
    assert default_every(steps) == every


extremes = st.floats(-300, 300).map(lambda exponent: 10.0**exponent) | st.just(0.0)


@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from(["sliding", "tumbling"]),
    st.sampled_from(["ungated", "gated"]),
    extremes,
    extremes,
    extremes,
    st.floats(-9, 9).map(lambda exponent: 10.0**exponent),
    st.tuples(*[st.floats(-1e6, 1e6)] * 3),
    st.integers(1, 50),
)
@pytest.mark.long
def test_every_scene_ends_with_a_verdict(model, contact, stiffness, damping, friction, mass, spin, steps):
    scene = from_mapping(
        {
            "cube": {"mass": mass},
            "ground": {"stiffness": stiffness, "damping": damping, "friction": friction, "contact": contact},
            "launch": {"angular_momentum": list(spin)},
        }
    )
    run = simulate(scene, model=model, steps=steps, every=1)
    assert Verdict(run.verdict[0]) in Verdict
    assert (run.steps_done[0] < steps) == (Verdict(run.verdict[0]) == Verdict.LEFT_NUMERIC_RANGE)
    assert np.isfinite(run.trajectory.state["position"]).all()


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_leaping_between_samples_keeps_the_same_states_to_round_off(model):
    scene = from_mapping({"ground": {"stiffness": 1e6, "contact": "gated"}, "duration": 1.5})
    stepped, leapt = (simulate(scene, model=model, steps=30_000, every=1000, leap=leap) for leap in (False, True))
    assert leapt.steps_computed[0] < 0.2 * stepped.steps_computed[0] == 0.2 * 30_000
    assert leapt.evaluations[0] == leapt.steps_computed[0]
    for name in ("position", "velocity"):
        np.testing.assert_allclose(leapt.trajectory.state[name], stepped.trajectory.state[name], atol=1e-10)


@pytest.mark.parametrize("tolerance", [0.0, 1e-14, 1.0, float("nan"), "small"])
def test_a_tolerance_out_of_range_is_refused(tolerance):
    with pytest.raises(InputError, match="tolerance"):
        simulate(from_mapping({}), steps=1, tolerance=tolerance)
