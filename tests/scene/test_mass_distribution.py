"""Masses of a box: centre and tensor against sums over many points, and what no body has."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stiffdice.errors import InputError
from stiffdice.scene import mass_distribution
from stiffdice.scene.cube import SIGNS, Cube
from stiffdice.scene.scene import from_mapping


def body(**keys):
    return from_mapping({"cube": keys}).cube


def summed(masses, places):
    centre = masses @ places / masses.sum()
    arms = places - centre
    return centre, sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, arms, strict=True))


def grid(sides, count=40):
    """Points evenly spread in a box."""
    ticks = (np.arange(count) + 0.5) / count - 0.5
    return np.stack(np.meshgrid(*(side * ticks for side in sides)), axis=-1).reshape(-1, 3)


@pytest.mark.parametrize(
    ("load", "place"),
    [
        ({"at": "corner", "mass": 0.4}, [0.6, 1.0, 0.3]),
        ({"at": "edge", "mass": 0.4, "faces": [6, 5]}, [-0.6, 0, -0.3]),
        ({"at": "face", "mass": 0.4, "faces": [4]}, [0, -1.0, 0]),
    ],
)
@pytest.mark.long
def test_a_loaded_box_is_a_box_and_a_point(load, place):
    sides = np.array([1.2, 2.0, 0.6])
    places = np.vstack([grid(sides), place])
    masses = np.append(np.full(len(places) - 1, (3.0 - 0.4) / (len(places) - 1)), 0.4)
    centre, tensor = summed(masses, places)
    found = body(sides=sides.tolist(), mass=3.0, load=load).distribution
    np.testing.assert_allclose(found.centre, centre, atol=1e-12)
    np.testing.assert_allclose(found.tensor, tensor, rtol=1e-3, atol=1e-3)  # so fine is the grid


def test_node_masses_are_points_at_the_nodes():
    masses = np.arange(1.0, 9.0)
    cube = body(side=1.5, node_masses=masses.tolist())
    centre, tensor = summed(masses, SIGNS * 0.75)
    np.testing.assert_allclose(cube.distribution.centre, centre, atol=1e-15)
    np.testing.assert_allclose(cube.distribution.tensor, tensor, atol=1e-13)
    np.testing.assert_allclose(masses @ cube.node_offsets(), 0, atol=1e-12)  # about the centre of mass
    assert cube.mass == masses.sum()


def test_eight_equal_node_masses_are_the_papers_corner_masses():
    assert body(side=1.5, node_masses=[0.25] * 8).moment_of_inertia == pytest.approx(
        Cube(radius=1.5 * 3**0.5 / 2, mass=2.0, geometry="exact", inertia="corners").moment_of_inertia, rel=1e-14
    )


def test_sides_of_a_cube_are_the_cube_of_that_side():
    box, cube = body(sides=[0.5, 0.5, 0.5]), body(side=0.5)
    assert box.radius == pytest.approx(cube.radius, rel=1e-15)
    assert box.moment_of_inertia == pytest.approx(cube.moment_of_inertia, rel=1e-14)
    np.testing.assert_allclose(box.node_offsets(), cube.node_offsets(), rtol=1e-15)


@pytest.mark.parametrize(
    "keys",
    [
        {"sides": [1, 2, 3]},
        {"side": 1, "node_masses": [1, 1, 1, 1, 1, 1, 1, 2]},
        {"side": 1, "load": {"at": "corner", "mass": 0.1, "faces": [6, 2, 3]}},
        {"side": 1, "moments": [0.1, 0.15, 0.2]},
    ],
)
def test_a_scene_comes_back_from_what_is_stored_of_it(keys):
    scene = from_mapping({"cube": keys, "launch": {"angular_momentum": "[1, 2, 3] rad/s"}})
    again = from_mapping(scene.as_mapping())
    assert again == scene
    assert again.digest == scene.digest


def test_the_papers_scenes_keep_their_digests():
    """Files made before there were boxes tell of the same scenes."""
    assert from_mapping({}).digest.startswith("5242db514eb2")


def test_a_spin_given_as_angular_velocity_is_that_of_the_box_as_launched():
    keys = {"sides": [1, 2, 3], "mass": 2.0}
    orientation = [0.4, -0.2, 0.9]
    scene = from_mapping({"cube": keys, "launch": {"angular_momentum": "[1, 2, 3] rad/s", "orientation": orientation}})
    tensor = mass_distribution.of_box(2.0, np.array([0.5, 1.0, 1.5]), "solid").tensor
    turn = Rotation.from_rotvec(orientation).as_matrix()
    np.testing.assert_allclose(scene.launch.spin, turn @ tensor @ turn.T @ [1, 2, 3], rtol=1e-12)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"sides": [1, 0, 1]}, r"cube.sides\[y\] = 0.0: allowed is a finite number > 0 \[m\]"),
        ({"sides": [1, 2]}, "cube.sides = .*three finite numbers"),
        ({"sides": 1}, "cube.sides = 1: .*cube.side"),
        ({"sides": [1, 1, 1], "side": 1}, "cube.side and cube.sides are both given"),
        ({"sides": [1, 1, 1], "radius": 2}, "cube.sides .* no cube.radius but half the diagonal"),
        ({"sides": [1, 1, 1], "geometry": "printed"}, "cube.sides .* cube.geometry = exact"),
        ({"node_masses": [1, -1, 1, 1, 1, 1, 1, 1]}, r"cube.node_masses\[1\] = -1: .*>= 0 \[kg\]"),
        ({"node_masses": [1, 1]}, "cube.node_masses = .*eight numbers"),
        ({"node_masses": [0, 0, 0, 0, 0, 0, 1, 1]}, "cube.node_masses = .*one line"),
        ({"node_masses": [1] * 8, "mass": 5}, "cube.node_masses .* no cube.mass but their sum"),
        ({"node_masses": [1] * 8, "inertia": "solid"}, "cube.node_masses .* cube.inertia = corners"),
        ({"node_masses": [1] * 8, "load": {"at": "face", "mass": 1}}, "cube.load and cube.node_masses are both"),
        ({"moments": [1, 1, 3]}, "cube.moments = .*no body has these"),
        ({"moments": [1, 1, -1]}, "cube.moments = .*no body has these"),
        ({"load": {"at": "face", "mass": 2}}, "cube.load.mass = 2: allowed is a part of cube.mass = 1 kg"),
        ({"load": {"at": "side", "mass": 0.1}}, "cube.load.at = side: allowed is face or edge or corner"),
        ({"load": {"at": "edge", "mass": 0.1, "faces": [1, 6]}}, "cube.load.faces = .* no two of them opposite"),
        ({"load": {"at": "edge", "mass": 0.1, "faces": [1]}}, "cube.load.faces = .* 2 of the faces 1 to 6"),
        ({"load": {"at": "edge", "mass": 0.1, "faces": [0, 2]}}, "cube.load.faces = "),
        ({"load": {"mass": 0.1}}, "cube.load.at is missing"),
        ({"load": 3}, "cube.load = 3: allowed are keys: at, mass, faces"),
    ],
)
def test_a_body_that_cannot_be_is_told_in_one_line(keys, told):
    with pytest.raises(InputError, match=told) as error:
        body(**keys)
    assert "\n" not in str(error.value)
