from __future__ import annotations

import numpy as np
import pytest

from stiffdice.simulation.criteria.judge import ending, judge, passes
from stiffdice.simulation.criteria.registry import CRITERIA, tolerances_of
from stiffdice.simulation.outcome import Verdict

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
