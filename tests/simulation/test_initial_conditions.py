from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.state import start_of
from stiffdice.errors import InputError
from stiffdice.scene.cube import Cube
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation.initial_conditions import phased, turned

SPINNING = {"launch": {"angular_momentum": [0.3, -0.4, 1.2], "orientation": [0.2, 0.5, 0.1]}}


def test_members_are_on_the_scenes_own_flight():
    launches, late = phased(Scene(), "sliding", 100, 8)
    np.testing.assert_allclose(late, np.arange(8) / 8 * 0.1, rtol=1e-15)
    np.testing.assert_allclose(launches["position"][:, 0], 5 * late, atol=1e-15)
    np.testing.assert_allclose(launches["position"][:, 2], 3 + 5 * late - 4.9 * late**2, atol=1e-15)
    energy = 0.5 * np.sum(launches["velocity"] ** 2, axis=1) + 9.8 * launches["position"][:, 2]
    np.testing.assert_allclose(energy, 54.4, atol=1e-13)


def test_the_first_member_is_the_scene_itself():
    scene = from_mapping({"launch": {"angular_momentum": {"seed": 5}}})
    for model in ("sliding", "tumbling"):
        np.testing.assert_array_equal(phased(scene, model, 100, 4).launches[:1], start_of(scene, model))
        np.testing.assert_array_equal(turned(scene, model, 4)[:1], start_of(scene, model))
        alone = phased(scene, model, 100, 1)
        np.testing.assert_array_equal(alone.launches, start_of(scene, model))
        assert alone.late.tolist() == [0]


def test_a_spinning_cube_has_turned_by_then():
    scene = from_mapping({"launch": {"angular_momentum": [0, 0, 0.1]}})
    members = phased(scene, "tumbling", 100, 2).launches
    angle = 0.1 / scene.cube.moment_of_inertia * 0.05
    before, after = members["node_offset"][:, 0]
    assert np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0]) == pytest.approx(angle, abs=1e-12)


def test_a_cube_that_only_slides_keeps_its_orientation():
    scene = from_mapping({"launch": {"angular_momentum": [3, 5, 1]}})
    for members in (phased(scene, "sliding", 500, 8).launches, turned(scene, "sliding", 8)):
        np.testing.assert_array_equal(members["node_offset"], np.repeat(members["node_offset"][:1], 8, axis=0))
        assert not members["angular_momentum"].any()


@pytest.mark.parametrize("position", [[0, 0, 0.3], [0, 0, -2], [0, 0, 0.5176]])
def test_a_launch_that_touches_the_ground_has_no_phases(position):
    scene = from_mapping({"launch": {"position": position, "velocity": [0, 0, -1]}})
    with pytest.raises(InputError, match="must clear the ground"):
        phased(scene, "sliding", 100, 4)
    assert len(phased(scene, "sliding", 100, 1).launches) == 1


def test_a_launch_that_touches_when_it_is_turned_has_no_phases():
    scene = from_mapping({"launch": {"position": [0, 0, 0.7], "velocity": [0, 0, 0]}})
    phased(scene, "tumbling", 10_000, 8)
    with pytest.raises(InputError, match="must clear the ground"):
        phased(scene, "tumbling", 10_000, 8, turned(scene, "tumbling", 8))


def test_each_member_goes_on_from_its_own_launch():
    scene = from_mapping(SPINNING)
    launches = turned(scene, "tumbling", 6)
    members, late = phased(scene, "tumbling", 100, 6, launches)
    np.testing.assert_allclose(members["position"][:, 0], 5 * late, atol=1e-15)
    np.testing.assert_array_equal(members["angular_momentum"], launches["angular_momentum"])
    for member, launch, delay in zip(members, launches, late, strict=True):
        spin = launch["angular_momentum"] / scene.cube.moment_of_inertia
        # What lies along the axis stays, and the angle is that of so long a turn.
        np.testing.assert_allclose(member["node_offset"] @ spin, launch["node_offset"] @ spin, atol=1e-12)
        turn = rotation_of(member) @ rotation_of(launch).T
        assert np.trace(turn) == pytest.approx(1 + 2 * np.cos(np.linalg.norm(spin) * delay), abs=1e-9)


def rotation_of(member):
    """The matrix that turns the upright cube's nodes into a member's."""
    upright = Cube().node_offsets()
    return np.linalg.lstsq(upright, member["node_offset"], rcond=None)[0].T


@pytest.mark.parametrize("count", [2, 32, 500])
def test_orientations_are_proper_rotations(count):
    for member in turned(from_mapping(SPINNING), "tumbling", count):
        turn = rotation_of(member)
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(turn) == pytest.approx(1, abs=1e-12)
        np.testing.assert_allclose(Cube().node_offsets() @ turn.T, member["node_offset"], atol=1e-12)


def test_orientations_and_axes_are_spread_evenly():
    """Of a uniform spread all means are those of theory: of the matrix, of its squares, of the angle of rotation."""
    count = 2000
    members = turned(from_mapping(SPINNING), "tumbling", count)
    turns = np.array([rotation_of(member) for member in members])
    np.testing.assert_allclose(turns.mean(axis=0), 0, atol=0.02)
    np.testing.assert_allclose((turns**2).mean(axis=0), 1 / 3, atol=0.02)
    np.testing.assert_allclose((turns**4).mean(axis=0), 1 / 5, atol=0.02)
    # Its angle has the density (1 − cos θ)/π, so that the trace, 1 + 2 cos θ, has the mean 0 and the variance 1.
    traces = np.trace(turns, axis1=1, axis2=2)
    assert traces.mean() == pytest.approx(0, abs=0.03)
    assert (traces**2).mean() == pytest.approx(1, abs=0.05)
    axes = members["angular_momentum"] / 1.3
    np.testing.assert_allclose(axes.T @ axes / count, np.eye(3) / 3, atol=0.01)
    np.testing.assert_allclose(axes.mean(axis=0), 0, atol=0.01)
    # A few are spread evenly, too: better than by chance, which leaves 1/√n.
    assert np.abs(turns[1:33].mean(axis=0)).max() < 0.6 / np.sqrt(32)


def test_axis_and_orientation_have_nothing_to_do_with_each_other():
    members = turned(from_mapping(SPINNING), "tumbling", 2000)
    turns = np.array([rotation_of(member) for member in members]).reshape(2000, 9)
    assert np.abs(turns.T @ members["angular_momentum"] / 1.3 / 2000).max() < 0.03


def test_the_spin_keeps_its_magnitude_and_the_place_is_the_scenes():
    scene = from_mapping(SPINNING)
    members = turned(scene, "tumbling", 64)
    np.testing.assert_allclose(np.linalg.norm(members["angular_momentum"], axis=1), 1.3, rtol=1e-12)
    for part in ("position", "velocity"):
        np.testing.assert_array_equal(members[part], np.repeat(start_of(scene, "tumbling")[part], 64, axis=0))


@pytest.mark.parametrize("node_velocity", ["translation", "rigid"])
def test_the_nodes_first_velocities_are_what_the_launch_says(node_velocity):
    scene = from_mapping({"launch": SPINNING["launch"] | {"node_velocity": node_velocity}})
    members = turned(scene, "tumbling", 8)
    rigid = members["angular_momentum"] / scene.cube.moment_of_inertia
    np.testing.assert_allclose(members["angular_velocity"], rigid if node_velocity == "rigid" else 0, rtol=1e-15)


def test_members_do_not_depend_on_how_many_there_are():
    few, many = (turned(from_mapping(SPINNING), "tumbling", count) for count in (8, 64))
    np.testing.assert_array_equal(few, many[:8])
