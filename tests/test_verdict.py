from __future__ import annotations

import numpy as np
import pytest

from stiffdice.verdict import CRITERIA, Verdict, criteria_of, judge


def judged(model="sliding", energy=1.0, apex=1.0, finite=True, sunk=False):
    measures = {"energy_ratio": np.array([energy]), "apex_ratio": np.array([apex])}
    return Verdict(judge(model, measures, np.array([finite]), np.array([sunk]))[0])


@pytest.mark.parametrize(
    ("run", "verdict"),
    [
        ({}, Verdict.PASSED),
        ({"energy": 1.05, "apex": 1.02}, Verdict.PASSED),
        ({"energy": 1.050001}, Verdict.ENERGY_GREW),
        ({"apex": 1.020001}, Verdict.APEX_ROSE),
        ({"apex": 2, "energy": 2}, Verdict.ENERGY_GREW),
        ({"apex": 2, "energy": 2, "sunk": True}, Verdict.SANK),
        ({"energy": 1001, "sunk": True}, Verdict.BLEW_UP),
        ({"energy": np.inf}, Verdict.BLEW_UP),
        ({"energy": np.nan}, Verdict.LEFT_NUMERIC_RANGE),
        ({"finite": False}, Verdict.LEFT_NUMERIC_RANGE),
        ({"apex": 2, "model": "tumbling"}, Verdict.PASSED),
        ({"energy": 2, "model": "tumbling"}, Verdict.ENERGY_GREW),
    ],
)
def test_the_worst_that_applies(run, verdict):
    assert judged(**run) == verdict


def test_every_verdict_has_its_sentence():
    assert len({verdict.sentence for verdict in Verdict}) == len(Verdict)


def test_a_criterion_never_holds_for_what_is_not_a_number():
    assert not CRITERIA["energy"].holds(np.nan)
    assert not CRITERIA["energy"].holds(np.inf, tolerance=1e300)


def test_a_studys_tolerance_goes_before_the_default():
    assert not CRITERIA["apex"].holds(1.03)
    assert CRITERIA["apex"].holds(1.03, tolerance=0.03)


def test_apex_means_nothing_where_the_cube_tumbles():
    assert set(criteria_of("sliding")) == {"energy", "apex"}
    assert set(criteria_of("tumbling")) == {"energy"}
