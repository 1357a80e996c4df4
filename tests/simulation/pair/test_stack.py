from __future__ import annotations

import numpy as np
import pytest

from stiffdice.scene.pair import from_mapping
from stiffdice.simulation.pair.run import simulate_pair

STIFFNESS, FRICTION, GRAVITY = 1e4, 0.5, 9.81


def twisted_stack(step, steps):
    """Two unit cubes at rest on each other, the upper one turned by 30°, so deep that springs carry their weight."""
    sag = GRAVITY / (4 * STIFFNESS)
    launches = [
        {"position": [0, 0, 0.5 - 2 * sag]},
        {"position": [0, 0, 1.5 - 3 * sag], "orientation": [0, 0, np.pi / 6]},
    ]
    cubes = [{"cube": {"side": 1, "mass": 1}, "launch": {"velocity": [0, 0, 0], **launch}} for launch in launches]
    ground = {"stiffness": STIFFNESS, "damping": 20, "friction": FRICTION}
    return from_mapping({"cubes": cubes, "ground": ground, "gravity": GRAVITY, "duration": step * steps})


def heading(state):
    corner = state["node_offset"][:, 0]
    return np.arctan2(corner[:, 1], corner[:, 0])


@pytest.mark.long
@pytest.mark.parametrize("steps", [100_000, pytest.param(1_000_000, marks=pytest.mark.broad)])
@pytest.mark.parametrize("scheme", ["symplectic_euler", "velocity_verlet"])
def test_a_twisted_stack_stays_for_ever_so_many_steps(scheme, steps):
    """What moves it is regularised friction in explicit steps, which turns speeds round at each: by up to μ g h."""
    step = 1e-4
    run = simulate_pair(twisted_stack(step, steps), scheme=scheme, steps=steps, every=steps // 100)
    assert run.verdict[0] == 0
    assert run.meetings[0] <= 1
    state = run.trajectory.state
    for name in "ab":
        place = state[name]["position"]
        assert np.abs(place[:, 2] - place[0, 2]).max() < 1e-9
        assert np.abs(place[:, :2]).max() < 3e-4
        assert np.abs(state[name]["velocity"]).max() < FRICTION * GRAVITY * step
    twist = heading(state["b"]) - heading(state["a"])
    assert np.abs(twist - twist[0]).max() < 1e-6
