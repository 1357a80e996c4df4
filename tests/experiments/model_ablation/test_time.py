from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.model_selection import least_model
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import physics_of, start_of
from stiffdice.experiments.model_ablation.time import pieces_of, take_with_tensor, tensor_of, time
from stiffdice.io.cf_enums import meanings_of
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation.engines import registry as engines


@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_each_scene_needs_all_but_its_piece(contact):
    found = pieces_of(Scene().with_ground(contact=contact))
    for name, (scene, _, least) in found.items():
        assert least_model(scene)[0] == least, name
    assert (found["tensor"][1], found["all"][1]) == ("tensor", "tumbling")


@pytest.mark.long
def test_a_tensor_that_turns_with_a_cube_changes_nothing():
    scene = from_mapping({"launch": {"angular_momentum": [0.3, 0.5, -0.2]}, "duration": 1.8})
    law, model, steps = LAWS["ungated"], MODELS["tumbling"], 3000
    plain = engines.ready("symplectic_euler", scene, "tumbling", steps, 1)()().states[1:]
    turning, tensor = start_of(scene, "tumbling"), tensor_of(scene)
    take_with_tensor(model, law, physics_of(scene), turning, tensor, scene.duration / steps, steps)
    for part in ("position", "velocity", "angular_momentum", "angular_velocity", "node_offset"):
        np.testing.assert_allclose(turning[part], plain[part], rtol=0, atol=1e-9, err_msg=part)
    assert np.abs(plain["node_offset"] - start_of(scene, "tumbling")["node_offset"]).max() > 0.5
    np.testing.assert_allclose(tensor, scene.cube.moment_of_inertia * np.eye(3), rtol=0, atol=1e-13)


@pytest.mark.long
def test_a_tensor_that_is_not_isotropic_turns_with_its_body():
    """A freely turning body keeps its angular momentum and, to the step's first order, its energy L·ω/2."""
    scene = from_mapping({"ground": {"contact": "gated"}, "launch": {"position": [0, 0, 99]}, "gravity": 0})
    state, tensor = start_of(scene, "tumbling"), tensor_of(scene)
    tensor[:] = np.diag([0.1, 0.2, 0.3])
    state["angular_momentum"] = spin = np.array([0.3, 0.1, 0.2])
    before = spin @ np.linalg.solve(tensor, spin) / 2
    take_with_tensor(MODELS["tumbling"], LAWS["gated"], physics_of(scene), state, tensor, 1e-4, 20_000)
    np.testing.assert_allclose(np.linalg.eigvalsh(tensor), [0.1, 0.2, 0.3], rtol=1e-9)
    assert np.abs(tensor - np.diag([0.1, 0.2, 0.3])).max() > 0.02
    assert spin @ np.linalg.solve(tensor, spin) / 2 == pytest.approx(before, rel=1e-3)


@pytest.mark.long
def test_times_are_told_apart_from_what_rebuilds_share():
    timed = time(Scene().with_ground(contact="gated"), steps=500, rounds=3)
    assert timed.step_time.dims == ("piece", "role")
    assert (timed.step_time > 0).all()
    bare = meanings_of(timed.piece).index("tensor")
    assert np.flatnonzero(np.isnan(timed.run_ratio)).tolist() == [bare]
    assert (timed.step_ratio > 0).all()
