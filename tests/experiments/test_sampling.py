from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments.sampling import states_of
from stiffdice.scene.scene import Scene
from stiffdice.simulation.run import simulate


def test_states_are_those_of_the_trajectory_and_none_after_its_end():
    run = simulate(Scene(), model="sliding", steps=1000, every=10)
    np.testing.assert_array_equal(states_of(run, 20), run.trajectory.state[::5])
    first = {"step": run.trajectory.step[:4], "state": run.trajectory.state[:4]}
    ended = dataclasses.replace(run, trajectory=dataclasses.replace(run.trajectory, **first))
    np.testing.assert_array_equal(states_of(ended, 100)[:4], run.trajectory.state[:4])
    assert np.isnan(states_of(ended, 100)["position"][4:]).all()


@pytest.mark.parametrize(("every", "parts"), [(None, 10), (10, 300), (10, 200), (30, 100)])
def test_a_run_without_states_at_these_times_is_refused(every, parts):
    with pytest.raises(InputError, match=f"no states after {parts} equal parts"):
        states_of(simulate(Scene(), model="sliding", steps=1000, every=every), parts)
