from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError
from stiffdice.experiments.pair import limits
from stiffdice.scene import scene as scenes

SCENE = scenes.load(Path(__file__).parents[3] / "config/scenes/equal-cubes.yaml")
MEETINGS = ("head_on", "edge_edge", "corner_face")


def test_longest_harmless_step_is_where_the_largest_gain_first_passes_the_tolerance():
    for tolerance in (0.01, 0.05, 0.2):
        longest = limits.longest_harmless(tolerance)
        below = np.linspace(0.01, longest * (1 - 1e-9), 4000)
        assert max(map(linear_theory.largest_gain, below)) <= 1 + tolerance
        assert linear_theory.largest_gain(longest * (1 + 1e-9)) > 1 + tolerance
    assert limits.longest_harmless(0.05) == pytest.approx(0.466, abs=5e-4)


@pytest.fixture(scope="module")
def meetings():
    return limits.measure(SCENE, cases=MEETINGS, stiffness=[1e3, 1e4, 1e5], count=60, members=8)


@pytest.mark.long
def test_meetings_need_the_steps_at_which_no_phase_gains_too_much(meetings):
    """Of the reduced mass: from the largest gain on, the scan's resolution and the gap before the last rise aside."""
    np.testing.assert_allclose(meetings.mode_number, [[8] * 3, [8] * 3, [2] * 3], rtol=1e-9)
    assert (meetings.first_pass > meetings.limit).all()
    assert (meetings.last_fail <= meetings.gain * 1.001).all()
    assert (meetings.last_fail >= 0.8 * meetings.gain).all()
    assert (meetings.bound > meetings.gain).all()
    np.testing.assert_allclose(meetings.exponent, 0.5, atol=0.03)


@pytest.mark.long
def test_a_damped_stack_needs_the_steps_of_the_linear_limit():
    found = limits.measure(SCENE, cases=["stacked"], stiffness=[1e3, 1e4], steps=[0.5, 2.0], count=30, members=8)
    np.testing.assert_allclose(found.mode_number, np.full((1, 2), 6 + np.sqrt(20)), rtol=1e-9)
    np.testing.assert_allclose(found.steps_needed / found.limit, 1.15, atol=0.15)
    assert (found.flips == 1).all()


@pytest.mark.parametrize("options", [{"cases": ["side"]}, {"stiffness": [0.0]}, {"speed": -1.0}, {"count": 1}])
def test_options_out_of_range_are_told(options):
    with pytest.raises(InputError, match=next(iter(options))):
        limits.measure(SCENE, **options)
