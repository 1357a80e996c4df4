from __future__ import annotations

import math

import pytest

from stiffdice.errors import InputError
from stiffdice.experiments.placement import STARTS, clearance, landing_speed, level
from stiffdice.scene.scene import Scene, from_mapping


def test_starts_are_where_they_are_said_to_be():
    scene = from_mapping({"cube": {"radius": 2.0, "mass": 3.0}})
    side, sag = scene.cube.side, 3 * 9.8 / 4e4
    clearances = {name: clearance(start(scene)) for name, start in STARTS.items()}
    expected = {"launch": 3 - side / 2, "at_rest": -sag, "touching": 0, "deep": -side / 2, "far_below": -3 * side}
    assert clearances == pytest.approx(expected, abs=1e-15)
    assert STARTS["touching"](scene).launch.position[2] == side / 2


def test_the_speed_is_that_of_a_free_fall():
    scene = level(Scene())
    assert landing_speed(scene) == pytest.approx(math.sqrt(5**2 + 2 * 9.8 * (3 - scene.cube.side / 2)))
    with pytest.raises(InputError, match="above it"):
        landing_speed(scene.with_ground(stiffness=1.0))
