from __future__ import annotations

import numpy as np
import pytest

from stiffdice.simulation.outcome import SEVERITY, Verdict, gravest


def test_every_verdict_has_its_sentence_and_its_place():
    assert len({verdict.sentence for verdict in Verdict}) == len(Verdict)
    assert set(SEVERITY) == set(Verdict)
    assert SEVERITY[0] == Verdict.PASSED
    assert "1000 times" in Verdict.BLEW_UP.sentence


def test_the_numbers_are_those_that_files_hold():
    """A new verdict gets a new number: files written before keep their meaning."""
    names = ["passed", "apex_rose", "energy_grew", "sank", "blew_up", "left_numeric_range"]
    names += ["restitution_off", "off_trajectory", "stalled", "undecided", "unresolved", "deep"]
    assert [verdict.name.lower() for verdict in Verdict] == names
    assert [int(verdict) for verdict in Verdict] == list(range(len(names)))


@pytest.mark.parametrize("order", [1, -1])
def test_the_gravest_goes_before_all_others_however_they_are_listed(order):
    for k, grade in enumerate(SEVERITY[1:], start=1):
        applies = {milder: np.array([True, False]) for milder in SEVERITY[1 : k + 1][::order]}
        assert gravest(applies).tolist() == [grade, Verdict.PASSED]


def test_one_answer_for_all_runs_and_an_answer_for_each():
    found = gravest({Verdict.SANK: True, Verdict.BLEW_UP: np.array([[True], [False]])})
    assert found.shape == (2, 1)
    assert found.dtype == np.int8
    assert found.ravel().tolist() == [Verdict.BLEW_UP, Verdict.SANK]
