"""Replays: their own paths without error, samples between steps, faces, and the same motion by another scheme."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests import toss_files

from stiffdice.dynamics.state import Ensemble
from stiffdice.experiments.tosses import replay
from stiffdice.experiments.tosses.replay import Physics
from stiffdice.simulation.run import simulate

PHYSICS = Physics(0.3, 0.25, 0.005)


@pytest.fixture(scope="module")
def made():
    return toss_files.made(4, PHYSICS)


@pytest.fixture(scope="module")
def scene(made):
    return replay.scene_of(made[0], PHYSICS, toss_files.SCENE)


def test_the_scene_has_the_measured_cube_and_the_ground_of_the_physics(made, scene):
    tosses, _ = made
    assert scene.cube.side == pytest.approx(0.1048, rel=1e-12)
    assert scene.cube.mass == tosses.mass
    np.testing.assert_allclose(scene.cube.distribution.tensor, 0.00081 * np.eye(3))
    assert scene.cube.distribution.is_isotropic
    omega = replay.step_of(scene, 1.0) ** -1
    assert omega == pytest.approx(np.sqrt(4 * scene.ground.stiffness / 0.37))
    for inertia, part in (("solid", 1 / 6), ("corners", 1 / 2)):
        other = replay.scene_of(tosses, PHYSICS._replace(inertia=inertia), toss_files.SCENE)
        assert other.cube.moment_of_inertia == pytest.approx(0.37 * 0.1048**2 * part)


def test_its_own_path_has_no_error(made, scene):
    """Also against a run of the whole time that keeps nothing in between: the states at the samples are the run's."""
    tosses, launches = made
    step = replay.whole_step(tosses.rate, replay.step_of(scene, 0.05))
    paths = replay.replay(tosses, launches, scene, step)
    off = replay.errors(tosses, paths)
    assert max(off.path.max(), off.orientation.max()) < 1e-9
    k, duration = 2, (tosses.counts[2] - 1) / tosses.rate
    run = simulate(
        dataclasses.replace(scene, duration=duration),
        steps=round(duration / step),
        members=Ensemble(launches.states(scene)[k : k + 1], np.zeros(1)),
    )
    np.testing.assert_allclose(paths.position[tosses.last[k]], run.end["position"][0], atol=1e-9)


@pytest.mark.parametrize("step", [0.0011, 0.004, 0.02])
def test_between_steps_the_flight_is_that_of_the_steps(made, scene, step):
    """Symplectic Euler's flight is off by g t h/2 at steps, and by a chord's g h²/8 more between them."""
    tosses, launches = made
    paths = replay.replay(tosses, launches, scene, step)
    time, first = np.arange(5) / tosses.rate, tosses.first[0]
    exact = launches.position[0] + time[:, None] * launches.velocity[0]
    exact[:, 2] -= 0.5 * scene.gravity * time**2
    off = np.linalg.norm(paths.position[first : first + 5] - exact, axis=1)
    assert (off <= scene.gravity * (time + step) * step / 2 + 1e-12).all()
    turned = Rotation.from_rotvec(launches.angular_velocity[0] * time[:, None]).as_matrix() @ launches.orientation[0]
    np.testing.assert_allclose(paths.orientation[first : first + 5], turned, atol=1e-9)


def test_errors_are_in_sides_and_by_the_angle(made):
    tosses, _ = made
    about = Rotation.from_rotvec(0.3 * np.array([1, 2, -2]) / 3).as_matrix()
    other = replay.Paths(tosses.position + np.array([0.0, 0.1048, 0.0]), about @ tosses.orientation)
    off = replay.errors(tosses, other)
    np.testing.assert_allclose(off.path, 1.0)
    np.testing.assert_allclose(off.orientation, 0.3)
    means = off.means(tosses)
    np.testing.assert_allclose(means.orientation, np.full(4, 0.3))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1.0, np.pi - 1e-6, np.pi])
def test_angles_of_rotations(angle):
    axis = np.array([2.0, -3.0, 6.0]) / 7
    found = replay.angles(Rotation.from_rotvec(angle * axis).as_matrix())
    assert found == pytest.approx(angle, abs=1e-14, rel=1e-7)


def test_the_mean_over_time_is_each_tosss_own(made):
    tosses, _ = made
    toss = np.repeat(np.arange(4), tosses.counts)
    means = replay.Errors(toss.astype(float), 2.0 * toss).means(tosses)
    np.testing.assert_allclose(means.path, np.arange(4))
    np.testing.assert_allclose(means.orientation, 2 * np.arange(4))


def test_what_left_the_range_is_infinitely_far(made):
    tosses, _ = made
    lost = replay.Paths(np.full_like(tosses.position, np.nan), np.full_like(tosses.orientation, np.nan))
    off = replay.errors(tosses, lost)
    assert np.isinf(off.path).all()
    assert np.isinf(off.orientation).all()


def test_faces_are_those_of_the_replayed_tosses(made, scene):
    tosses, launches = made
    faces = replay.faces(launches, scene, replay.step_of(scene, 0.05))
    np.testing.assert_array_equal(faces, tosses.faces[tosses.last])


@pytest.mark.long
def test_paths_go_to_those_of_a_scheme_without_steps(made, scene):
    """The distance to `event` falls as the step does, over a factor of 16 by 16 within a factor of 3."""
    tosses, launches = made
    exact = replay.replay(tosses, launches, scene, 1 / tosses.rate, scheme="event", tolerance=1e-9)
    steps = [replay.whole_step(tosses.rate, replay.step_of(scene, value)) for value in (0.16, 0.01)]
    coarse, fine = (
        np.median(replay.errors(tosses, replay.replay(tosses, launches, scene, step), exact).path) for step in steps
    )
    assert 16 / 3 < coarse / fine < 16 * 3
