"""Verdicts at the extremes: what a run that nobody would make is said to be."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.scene import from_mapping
from stiffdice.simulate import simulate
from stiffdice.verdict import Verdict


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
