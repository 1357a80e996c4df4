from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models.registry import MODELS, touches, turns
from stiffdice.dynamics.state import TOUCHING, TURNING, start_of
from stiffdice.errors import InputError
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate


@pytest.mark.parametrize("contact", ["ungated", "gated"])
@pytest.mark.parametrize("every", [None, 50], ids=["leaping", "stepping"])
@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"ground": {"stiffness": 1e6, "damping": 3}},
        {"ground": {"stiffness": 30, "damping": 0}},  # so soft that the upper nodes go in, too
        {"launch": {"position": [0.7, -0.2, 2.5], "velocity": [0, 0, -3], "orientation": [0.3, 0.2, 0.9]}},
        {"cube": {"radius": 0.03, "mass": 0.2, "geometry": "exact"}, "launch": {"position": [0, 0, 0.5]}},
    ],
    ids=str,
)
def test_it_is_sliding_to_the_last_bit_where_nothing_slides(contact, every, keys):
    keys = {"launch": {}, "ground": {}} | keys
    keys["launch"] = {"velocity": [0, 0, 5]} | keys["launch"]
    scene = from_mapping(keys | {"ground": {"contact": contact, "friction": 0.3} | keys["ground"], "duration": 5.0})
    vertical, sliding = (simulate(scene, model=model, steps=5000, every=every) for model in ("vertical", "sliding"))
    np.testing.assert_array_equal(vertical.end, sliding.end)
    np.testing.assert_array_equal(vertical.steps_computed, sliding.steps_computed)
    for name, measure in sliding.measures.items():
        np.testing.assert_array_equal(vertical.measures[name], measure, err_msg=name)
    if every:
        np.testing.assert_array_equal(vertical.trajectory.state, sliding.trajectory.state)


@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_speed_along_the_ground_and_spin_are_left_out(contact):
    aside = {"velocity": [5, -2, 5], "angular_momentum": [0.3, 0.5, 0.2], "node_velocity": "rigid"}
    thrown, dropped = (
        simulate(from_mapping({"ground": {"contact": contact}, "launch": launch}), model="vertical", steps=5000)
        for launch in (aside, {"velocity": [0, 0, 5]})
    )
    np.testing.assert_array_equal(thrown.end, dropped.end)


@pytest.mark.parametrize("normal", [[0.1, 0, 1], [1, 0, 0], [0, 0, -1]])
def test_ground_that_is_not_level_is_refused(normal):
    scene = from_mapping({"ground": {"normal": normal}})
    with pytest.raises(InputError, match=r"model = vertical: ground.normal = .*allowed is level ground"):
        simulate(scene, model="vertical", steps=10)


@pytest.mark.long
def test_the_sets_of_models_say_what_the_models_say():
    @njit
    def asked(model):
        return turns(model), touches(model)

    told = {name: asked(tag) for name, tag in MODELS.items()}
    assert told == {name: (name in TURNING, name in TOUCHING) for name in MODELS}


def test_a_flying_cube_keeps_its_spin_and_falls_freely():
    spin = [0.3, -0.2, 0.6]
    scene = from_mapping({"launch": {"position": [0, 0, 100], "angular_momentum": spin}, "duration": 2.0})
    flying, full = (
        simulate(scene.with_ground(contact="gated"), model=model, steps=2000, every=500)
        for model in ("flying", "tumbling")
    )
    np.testing.assert_array_equal(flying.trajectory.state, full.trajectory.state)
    np.testing.assert_array_equal(flying.end["angular_momentum"][0], spin)
    start = start_of(scene, "flying")
    assert np.abs(flying.end["node_offset"] - start["node_offset"]).max() > 0.1
