from __future__ import annotations

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation import fixed_step
from stiffdice.simulation.run import simulate


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_bare_steps_are_those_of_the_simulator_to_the_last_bit(model):
    scene = from_mapping({"launch": {"angular_momentum": [0.3, 0.5, 0.2]}, "duration": 2.0}, "as_written")
    run = fixed_step.prepare(scene, model, "symplectic_euler", 10, 20_000)
    kept = simulate(scene, model=model, steps=20_000, every=2000)
    path = run()
    assert path.states.tobytes() == kept.trajectory.state.tobytes()
    assert path.evaluations == path.computed == int(kept.evaluations[0]) == 20_000
    np.testing.assert_array_equal(run().states, path.states)  # the launch is as it was


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (("sliding", "symplectic_euler", 10, 25), "steps = 25: allowed is a multiple of samples = 10"),
        (("sliding", "leapfrog", 10, 20), "scheme = leapfrog"),
        (("rolling", "symplectic_euler", 10, 20), "model = rolling"),
    ],
)
def test_what_cannot_be_stepped_is_said(names, told):
    with pytest.raises(InputError, match=told):
        fixed_step.prepare(Scene(), *names)
