"""Random launches have the distribution that they state, and a seed says each."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.state import turned_tensor
from stiffdice.errors import InputError
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.launch_distribution import BLOCK, LaunchDistribution

BOX = from_mapping(
    {
        "cube": {"sides": [0.1, 0.12, 0.2], "mass": 0.3},
        "launch": {"position": [0, 0, 1], "velocity": [1, 2, 3], "angular_momentum": {"seed": 0, "low": -1, "high": 2}},
    }
)


def test_a_launch_is_the_same_however_many_are_drawn():
    some = LaunchDistribution(seed=3)
    whole = some.draw(BOX, BLOCK + 20)
    assert some.draw(BOX, 30, first=BLOCK - 10).tobytes() == whole[BLOCK - 10 : BLOCK + 20].tobytes()
    assert LaunchDistribution(seed=4).draw(BOX, 5).tobytes() != whole[:5].tobytes()


def test_orientations_are_uniform_over_all_rotations():
    """Each edge points anywhere as likely, and so does the rotation about it: means and second moments."""
    nodes = LaunchDistribution().draw(BOX, 20_000)["node_offset"]
    edges = nodes[:, [0, 0, 0]] - nodes[:, [3, 1, 4]]
    edges /= np.linalg.norm(edges, axis=2, keepdims=True)
    error = 5 / np.sqrt(20_000)
    assert np.abs(edges.mean(axis=0)).max() < error
    moments = np.einsum("mij,mkl->ijkl", edges, edges) / 20_000
    assert np.abs(moments - np.einsum("ik,jl->ijkl", np.eye(3), np.eye(3)) / 3).max() < error
    np.testing.assert_allclose(np.linalg.det(edges), 1, atol=1e-12)


def test_velocities_and_spins_are_gaussian_about_the_scenes():
    launches = LaunchDistribution(velocity_spread=0.5, spin_spread=20.0).draw(BOX, 20_000)
    np.testing.assert_allclose(launches["velocity"].mean(axis=0), [1, 2, 3], atol=0.02)
    np.testing.assert_allclose(launches["velocity"].std(axis=0), 0.5, rtol=0.03)
    np.testing.assert_allclose(launches["angular_velocity"].std(axis=0), 20, rtol=0.03)
    tensors = turned_tensor(BOX.cube, launches["node_offset"])
    np.testing.assert_allclose(
        np.einsum("mij,mj->mi", tensors, launches["angular_velocity"]), launches["angular_momentum"], rtol=1e-9
    )


def test_the_papers_spin_is_uniform_in_each_component_of_the_momentum():
    momenta = LaunchDistribution(orientation="as_launched", spin_spread=None).draw(BOX, 20_000)["angular_momentum"]
    assert momenta.min() >= -1
    assert momenta.max() < 2
    np.testing.assert_allclose(momenta.mean(axis=0), 0.5, atol=0.03)
    np.testing.assert_allclose(momenta.std(axis=0), 3 / 12**0.5, rtol=0.03)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"orientation": "any"}, "launches.orientation = any: allowed is uniform or as_launched"),
        ({"velocity_spread": -1}, "launches.velocity_spread = -1"),
        ({"spin_spread": "fast"}, "launches.spin_spread"),
        ({"seed": -1}, "launches.seed = -1"),
    ],
)
def test_values_out_of_range_are_told(given, told):
    with pytest.raises(InputError, match=told):
        LaunchDistribution(**given)


def test_a_launch_in_the_ground_is_refused():
    low = from_mapping({"launch": {"position": [0, 0, 0.5]}})
    with pytest.raises(InputError, match=r"node .* below the ground"):
        LaunchDistribution().draw(low, 5)
