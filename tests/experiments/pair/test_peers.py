from __future__ import annotations

import math

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments.pair import motion, peers, threads
from stiffdice.experiments.pair.peers import OURS, Ours
from stiffdice.io.cf_enums import meanings_of
from stiffdice.scene.pair import from_mapping
from stiffdice.scene.scene import Scene

FEW = {"omega_h": (0.1, 8.0), "count": 3, "phases": 2, "depth": [0.1, 0.4, 0.6], "angle": [1e-9, 1e-3], "duration": 0.2}


@pytest.fixture(scope="module")
def found():
    return peers.measure(Scene(), **FEW).isel(method=0)


def test_a_throw_in_short_steps_keeps_its_energy_and_one_in_long_steps_does_not(found):
    np.testing.assert_allclose(found.energy_ratio[0], 1.0, atol=5e-3)
    assert float(found.energy_ratio[-1].max()) > 100  # no explicit scheme is stable beyond ωh = 2


def test_cubes_leave_depth_with_the_springs_energy_and_none_beyond_half_a_side(found):
    side, stiffness, reduced = 0.071, threads.PRODUCT_STIFFNESS, 0.05
    flush = side * found.depth.values * math.sqrt(4 * stiffness / reduced)
    np.testing.assert_allclose(found.energy_speed[:2], flush[:2], rtol=1e-12)
    np.testing.assert_allclose(found.exit_speed[:2], flush[:2], rtol=2e-3)
    assert np.isnan(found.exit_speed[2])


@pytest.mark.parametrize("angle", [1e-9, 1e-8, 1e-6, 1e-4])
@pytest.mark.parametrize("turn", list(threads.TURNS))
def test_the_force_hardly_changes_with_next_to_no_turn(turn, angle):
    """A tilt by an angle moves the middle of the patch, 2 mm from the axis, by so much of the depth, 0.1 mm."""
    flush = Ours().pushed(threads.turned(turn, 0.0))
    for sign in (-1, 1):
        push = Ours().pushed(threads.turned(turn, sign * angle))
        assert np.abs(push.force - flush.force).max() <= 25 * angle * flush.force[2]


@pytest.mark.parametrize("depth", [1e-4, 1e-5])
def test_the_torque_jumps_by_no_more_than_the_couples_of_four_edges(depth):
    """Solid angles have kinks at parallel edges: each of four makes S d²/π at the most, less and less beside S d."""
    for turn in threads.TURNS:
        torques = [Ours().pushed(threads.turned(turn, angle, depth)).torque for angle in (-1e-9, 0.0, 1e-9)]
        jump = np.abs(np.diff(torques, axis=0)).max()
        assert jump <= 1.01 * 4 / math.pi * 200.0 * depth**2


def test_a_stack_rests_on_its_springs_at_any_twist_without_losing_contact():
    height, mass, stiffness = 0.014, 3.92e-3, 200.0
    settled = peers.measure(Scene(), **{**FEW, "duration": 1.0}).isel(method=0)
    sag = mass * 9.81 / (4 * stiffness)
    np.testing.assert_allclose(settled.rest_height, 1.5 * height - 3 * sag, atol=1e-9)
    assert not settled.switches.any()


def test_depths_are_the_least_way_out(found):
    np.testing.assert_allclose(found.known_depth, [2e-5, 0.05, 0.2], rtol=1e-3)
    np.testing.assert_allclose(found.depth_ratio, 1.0, rtol=1e-9)


def test_the_way_out_of_crossed_edges_is_along_their_common_normal():
    height, turns = 5.0 + math.sqrt(2) - 0.1, ([math.pi / 4, 0, 0], [0, math.pi / 4, 0])
    cubes = [
        {"cube": {"side": 1.0}, "launch": {"position": [0, 0, z], "orientation": turn}}
        for z, turn in zip((5.0, height), turns, strict=True)
    ]
    assert motion.overlap_of(from_mapping({"cubes": cubes})) == pytest.approx(0.1, rel=1e-12)


def test_a_quaternion_turns_a_box_as_its_rotation_vector_does():
    scene = threads.turned("twist", 0.3)
    _, (w, *vector) = motion.pose_of(scene.parts[1])
    assert (w, vector) == (pytest.approx(math.cos(0.15)), pytest.approx([0, 0, math.sin(0.15)]))


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"methods": ["rk4"]}, "methods = rk4"),
        ({"depth": [0.0]}, "depth = 0"),
        ({"angle": [-1e-6]}, "angle = -1e-06"),
        ({"phases": 0}, "phases = 0"),
        ({"duration": 0}, "duration = 0"),
        ({"omega_h": [1.0, 0.1]}, "omega_h"),
    ],
)
def test_what_cannot_be_measured_is_said(options, told):
    with pytest.raises(InputError, match=told):
        peers.measure(Scene(), **options)


@pytest.fixture(scope="module")
def mujoco():
    pytest.importorskip("mujoco")
    from stiffdice.experiments.pair.in_mujoco import Mujoco

    return Mujoco


def test_mujocos_contacts_are_our_springs_face_to_face(mujoco):
    scene = threads.turned("twist", 0.0)
    ours, theirs = Ours().pushed(scene), mujoco(springs=True).pushed(scene)
    np.testing.assert_allclose(theirs.force, ours.force, atol=1e-3 * ours.force[2])
    # We have couples of (2/π) S d² besides, here 0.02 of the torque.
    np.testing.assert_allclose(theirs.torque, ours.torque, atol=2 / math.pi * 200.0 * 1e-8 * 1.01)
    assert theirs.contacts == ours.contacts == 4


def test_mujocos_springs_are_more_where_it_finds_more_contacts(mujoco):
    scene = threads.turned("twist", 1e-9)
    flush, twisted = (mujoco(springs=True).pushed(there) for there in (threads.turned("twist", 0.0), scene))
    assert twisted.force[2] / flush.force[2] == pytest.approx(twisted.contacts / flush.contacts, rel=1e-3)


def test_with_our_springs_mujoco_leaves_depth_as_we_do(mujoco):
    scene = threads.inside(0.3, 0.1)
    ours, theirs = Ours().ended(scene, 5e-4), mujoco(springs=True).ended(scene, 5e-4)
    np.testing.assert_allclose(theirs.velocity, ours.velocity, atol=1e-3 * np.abs(ours.velocity).max())


def test_mujocos_own_contact_never_ends_with_more_energy(mujoco):
    for omega_h in (0.5, 8.0):
        scene = threads.thrown(omega_h, 1e-3, 0.25)
        assert motion.kinetic_of(scene, mujoco().ended(scene, 1e-3)) < motion.kinetic_of(scene, motion.launched(scene))


@pytest.fixture(scope="module")
def drake():
    pytest.importorskip("pydrake")
    from stiffdice.experiments.pair.in_drake import Drake

    return Drake


@pytest.mark.long
def test_drake_finds_convex_cubes_deeper_than_they_are(drake):
    scene = threads.posed("corner")
    assert drake().depth(scene) == pytest.approx(0.05, rel=1e-9)
    assert drake(convex=True).depth(scene) == pytest.approx(math.sqrt(3) * 0.05, rel=1e-6)


@pytest.mark.long
def test_drakes_springs_lose_energy_in_long_steps_and_its_dashpot_makes_some(drake):
    ratios = {}
    for springs in (True, False):
        scenes = [threads.thrown(8.0, 1e-3, phase) for phase in (0.0, 0.25)]
        after = [motion.kinetic_of(scene, drake(springs=springs).ended(scene, 1e-3)) for scene in scenes]
        ratios[springs] = max(after) / motion.kinetic_of(scenes[0], motion.launched(scenes[0]))
    assert ratios[True] < 1
    assert ratios[False] > 5


def test_methods_are_asked_in_every_way_that_they_have():
    pytest.importorskip("mujoco")
    asked = peers.measure(Scene(), methods=[OURS, "mujoco"], **FEW)
    assert meanings_of(asked.method) == [OURS, "mujoco", "mujoco_default", "mujoco_mesh"]
    assert "mujoco" in asked.attrs["engine_versions"]
