from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from stiffdice.dynamics.state import physics_of
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation.criteria.judge import ending, judge, passes, stalled, sunk
from stiffdice.simulation.criteria.registry import CRITERIA, tolerances_of
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import simulate

GOOD = {"out_of_range": 0.0, "energy_ratio": 1.0, "apex_ratio": 1.0, "restitution_error": 0.0, "trajectory_error": 0.0}
ALL = {name: part.TOLERANCE for name, part in CRITERIA.items()}


def judged(tolerances=ALL, endings=(), **measures):
    values = {name: np.array([value]) for name, value in (GOOD | measures).items()}
    ended = ending(values, {verdict: np.array([True]) for verdict in endings})
    passed = [bool(row[0]) for row in passes(tolerances, values, ended)] if tolerances else [ended[0] == Verdict.PASSED]
    verdict = Verdict(judge(tolerances, values, ended)[0])
    assert all(passed) == (verdict == Verdict.PASSED)  # of a run and of a cell's member alike
    return verdict


@pytest.mark.parametrize(
    ("run", "verdict"),
    [
        ({}, Verdict.PASSED),
        ({"energy_ratio": 1.05, "apex_ratio": 1.02}, Verdict.PASSED),
        ({"restitution_error": 0.05, "trajectory_error": 0.05}, Verdict.PASSED),
        ({"energy_ratio": 1.050001}, Verdict.ENERGY_GREW),
        ({"apex_ratio": 1.020001}, Verdict.APEX_ROSE),
        ({"restitution_error": 0.050001}, Verdict.RESTITUTION_OFF),
        ({"trajectory_error": 0.050001}, Verdict.OFF_TRAJECTORY),
        ({"trajectory_error": np.nan}, Verdict.OFF_TRAJECTORY),
        ({"restitution_error": np.nan}, Verdict.RESTITUTION_OFF),
        ({"trajectory_error": 1, "restitution_error": 1}, Verdict.RESTITUTION_OFF),
        ({"restitution_error": 1, "apex_ratio": 2}, Verdict.APEX_ROSE),
        ({"apex_ratio": 2, "energy_ratio": 2}, Verdict.ENERGY_GREW),
        ({"endings": [Verdict.UNRESOLVED]}, Verdict.UNRESOLVED),
        ({"energy_ratio": 2, "endings": [Verdict.UNRESOLVED]}, Verdict.ENERGY_GREW),
        ({"energy_ratio": 2, "endings": [Verdict.SANK]}, Verdict.SANK),
        ({"endings": [Verdict.SANK, Verdict.STALLED]}, Verdict.STALLED),
        ({"energy_ratio": 2, "endings": [Verdict.UNDECIDED]}, Verdict.UNDECIDED),
        ({"energy_ratio": 1001, "endings": [Verdict.SANK, Verdict.UNDECIDED]}, Verdict.BLEW_UP),
        ({"energy_ratio": np.inf}, Verdict.BLEW_UP),
        ({"energy_ratio": np.nan}, Verdict.LEFT_NUMERIC_RANGE),
        ({"energy_ratio": 2000, "out_of_range": 1}, Verdict.LEFT_NUMERIC_RANGE),
    ],
)
def test_the_gravest_that_applies(run, verdict):
    assert judged(**run) == verdict


@pytest.mark.parametrize(
    "measure", ["energy_ratio", "apex_ratio", "restitution_error", "trajectory_error"], ids=lambda name: name
)
def test_what_is_not_asked_is_not_held_against_a_run(measure):
    others = {name for name, part in CRITERIA.items() if measure != part.MEASURE}
    asked = {name: tolerance for name, tolerance in ALL.items() if name in others}
    assert judged(asked, **{measure: 3.0}) == Verdict.PASSED
    assert judged(ALL, **{measure: 3.0}) != Verdict.PASSED


@pytest.mark.parametrize("run", [{"energy_ratio": 1e4}, {"out_of_range": 1}, {"endings": [Verdict.SANK]}])
def test_how_a_run_ended_counts_whatever_is_asked(run):
    assert judged({}, **run) not in (Verdict.PASSED, Verdict.ENERGY_GREW)


def test_a_studys_tolerance_goes_before_the_default():
    assert judged(ALL, apex_ratio=1.03) == Verdict.APEX_ROSE
    assert judged(ALL | {"apex": 0.03}, apex_ratio=1.03) == Verdict.PASSED


def test_apex_means_nothing_where_the_cube_tumbles():
    assert judged(tolerances_of("tumbling", ALL), apex_ratio=2, restitution_error=2) == Verdict.PASSED
    assert judged(tolerances_of("tumbling", ALL), energy_ratio=2) == Verdict.ENERGY_GREW


def test_an_array_of_runs_is_judged_one_by_one():
    measures = {name: np.full((2, 3), value) for name, value in GOOD.items()}
    measures["apex_ratio"][1, 2] = 2
    found = judge(ALL, measures, ending(measures, {}))
    assert found.shape == (2, 3)
    assert found.dtype == np.int8
    assert np.argwhere(found).tolist() == [[1, 2]]


def ended(steps, budget=None, **keys):
    run = simulate(from_mapping(keys), model="sliding", steps=steps, budget=budget)
    return Verdict(run.verdict[0]), {name: float(value[0]) for name, value in run.measures.items()}


@pytest.mark.parametrize("stiffness", [0.0, 1e-6, 0.01])
def test_a_ground_too_soft_to_carry_hides_no_gain(stiffness):
    """Explicit damping throws the cube up from 89 m below: 5.8 kJ of 54 J, however far away its rest would be."""
    verdict, measures = ended(3, ground={"stiffness": stiffness, "contact": "gated", "friction": 0})
    assert verdict == Verdict.ENERGY_GREW
    assert measures["energy_ratio"] == pytest.approx(100, rel=1)


@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_a_step_through_the_ground_is_told(contact):
    assert ended(1, ground={"contact": contact})[0] == Verdict.SANK


def test_a_small_cube_within_a_bounce_has_not_sunk():
    """Deeper than it is large, half a period after touch-down, and on its way up later."""
    keys = {"cube": {"radius": 0.01, "geometry": "exact"}, "ground": {"contact": "gated", "friction": 0, "damping": 0}}
    keys["launch"] = {"position": [0, 0, 1.0], "velocity": [0, 0, 0]}
    fall = np.sqrt(2 * (1 - 0.01 / np.sqrt(3)) / 9.8)
    whole = fall + np.pi / 2 / np.sqrt(8e4)
    assert ended(10_000, **keys, duration=whole)[0] == Verdict.PASSED
    assert ended(10_000, **keys, duration=3 * fall)[0] == Verdict.PASSED
    soft = keys | {"ground": keys["ground"] | {"stiffness": 10.0}}
    assert ended(10_000, **soft, duration=whole)[0] == Verdict.SANK  # here its rest is below the ground


def test_a_launch_that_round_off_swallows_is_stalled_whatever_the_budget():
    keys = {"cube": {"radius": 1e9, "geometry": "exact"}, "launch": {"position": [0, 0, 1e9], "velocity": [5, 0, 5]}}
    assert ended(10**9, budget=100, **keys)[0] == Verdict.STALLED
    assert ended(10**8, budget=100, **keys)[0] == Verdict.UNDECIDED


def test_a_budget_spent_is_undecided():
    assert ended(10_000, budget=1000)[0] == Verdict.UNDECIDED
    assert ended(10_000, budget=10_000)[0] == Verdict.PASSED


def test_steps_beyond_the_linear_limit_of_a_contact_that_was_met_are_unresolved():
    keys = {"ground": {"stiffness": 1e6, "contact": "gated", "damping": 0}}
    for height, verdict in ((3, Verdict.UNRESOLVED), (4000, Verdict.PASSED)):
        scene = from_mapping(keys | {"launch": {"position": [0, 0, height]}})
        run = simulate(scene, model="sliding", steps=9_999, criteria={"energy": 1e6})
        assert Verdict(run.verdict[0]) == verdict


@pytest.mark.parametrize("fall", [0.0, 0.5])
def test_a_cube_swings_twice_as_deep_as_it_rests_and_deeper_by_what_it_fell_with(fall):
    """Without energy it swings from 0 to 2 m g/(4S); with energy E it goes deeper by less than √(E/(2S))."""
    physics, sag = physics_of(Scene()), 0.5
    memory, sight = np.zeros(2, [("energy", float, 3)]), np.zeros(2, [("sag", float)])
    memory["energy"][:, 2], sight["sag"] = 2 * physics.stiffness * fall**2, sag
    ends = {"position": np.zeros((2, 3)), "node_offset": np.zeros((2, 8, 3))}
    ends["position"][:, 2] = -(2 * sag + fall) * np.array([0.999, 1.001])
    assert sunk(physics, SimpleNamespace(ensemble=ends, memory=memory, sight=sight)).tolist() == [False, True]


def test_a_step_is_lost_in_the_place_it_goes_from_to_where_it_goes():
    """Below 1 doubles lie half as far apart as above it: a step of 2⁻⁵³ is lost upwards, not downwards."""
    launches = {"position": np.ones((3, 1)), "velocity": np.array([[1.0], [-1.0], [0.0]])}
    assert stalled(launches, 2.0**-53).tolist() == [True, False, False]
    assert stalled(launches, 2.0**-52).tolist() == [False, False, False]
