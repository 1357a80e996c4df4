from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.state import STATE
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.criteria import finite
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import simulate

TOO_STIFF = {"cube": {"mass": 1e-9}, "ground": {"stiffness": 1e308, "contact": "gated"}}


@pytest.mark.parametrize("every", [None, 1])
@pytest.mark.parametrize(("keys", "measure"), [({}, 0), (TOO_STIFF, 1)])
def test_it_is_one_where_a_number_left_the_range_of_doubles(keys, measure, every):
    run = simulate(from_mapping(keys), model="sliding", steps=100, every=every)
    assert run.measures["out_of_range"][0] == measure
    assert (Verdict(run.verdict[0]) == Verdict.LEFT_NUMERIC_RANGE) == bool(measure)
    assert (run.steps_done[0] < 100) == bool(measure)


@pytest.mark.parametrize("part", ["position", "velocity", "angular_momentum", "node_offset"])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_no_part_of_a_state_escapes(part, axis, value):
    state, slots = np.zeros(1, STATE), np.zeros(finite.SLOTS)
    assert finite.observe(slots, None, None, state[0], None) == (0.0, False)
    state[part][(0, 0, axis) if part == "node_offset" else (0, axis)] = value
    assert finite.observe(slots, None, None, state[0], None)[0] == 1.0
