from __future__ import annotations

import numpy as np
import pytest

from stiffdice.ensemble import phased
from stiffdice.errors import InputError
from stiffdice.scene import Scene, from_mapping
from stiffdice.state import start_of


def test_members_are_on_the_scenes_own_flight():
    members = phased(Scene(), "sliding", 100, 8)
    late = np.arange(8) / 8 * 0.1
    np.testing.assert_allclose(members["position"][:, 0], 5 * late, atol=1e-15)
    np.testing.assert_allclose(members["position"][:, 2], 3 + 5 * late - 4.9 * late**2, atol=1e-15)
    energy = 0.5 * np.sum(members["velocity"] ** 2, axis=1) + 9.8 * members["position"][:, 2]
    np.testing.assert_allclose(energy, 54.4, atol=1e-13)


def test_the_first_member_is_the_scene_itself():
    scene = from_mapping({"launch": {"angular_momentum": {"seed": 5}}})
    for model in ("sliding", "tumbling"):
        np.testing.assert_array_equal(phased(scene, model, 100, 4)[:1], start_of(scene, model))
        np.testing.assert_array_equal(phased(scene, model, 100, 1), start_of(scene, model))


def test_a_spinning_cube_has_turned_by_then():
    scene = from_mapping({"launch": {"angular_momentum": [0, 0, 0.1]}})
    members = phased(scene, "tumbling", 100, 2)
    angle = 0.1 / scene.cube.moment_of_inertia * 0.05
    before, after = members["node_offset"][:, 0]
    assert np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0]) == pytest.approx(angle, abs=1e-12)


def test_a_cube_that_only_slides_keeps_its_orientation():
    scene = from_mapping({"launch": {"angular_momentum": [3, 5, 1]}})
    offsets = phased(scene, "sliding", 500, 8)["node_offset"]
    np.testing.assert_array_equal(offsets, np.broadcast_to(offsets[0], offsets.shape))


@pytest.mark.parametrize("position", [[0, 0, 0.3], [0, 0, -2], [0, 0, 0.5176]])
def test_a_launch_that_touches_the_ground_has_no_phases(position):
    scene = from_mapping({"launch": {"position": position, "velocity": [0, 0, -1]}})
    with pytest.raises(InputError, match="must clear the ground"):
        phased(scene, "sliding", 100, 4)
    assert len(phased(scene, "sliding", 100, 1)) == 1
