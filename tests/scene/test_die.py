"""Faces of a die: their pips, the heights at which it rests and tips, and the face it would come to lie on."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.scene import die
from stiffdice.scene.cube import SIGNS

HALF = np.array([1.0, 0.7, 0.4])
CENTRE = np.array([0.1, -0.2, 0.15])


def test_opposite_faces_sum_to_seven_and_one_two_three_turn_counterclockwise():
    for face in die.FACES:
        np.testing.assert_array_equal(die.NORMALS[face - 1], -die.NORMALS[die.opposite(face) - 1])
        assert face + die.opposite(face) == 7
    one, two, three = die.NORMALS[:3]
    assert np.linalg.det([one, two, three]) > 0  # seen from outside, at the corner that the three share


def height(down, nodes):
    """The centre of mass over the lowest node."""
    return (nodes @ down).max(axis=0)


def test_heights_at_rest_are_those_over_the_lowest_node():
    nodes = SIGNS * HALF - CENTRE
    np.testing.assert_allclose(die.rest_heights(HALF, CENTRE), height(die.NORMALS.T, nodes))


def test_a_die_tips_over_the_edge_that_is_nearest_to_its_centre_of_mass():
    """The height that must be overcome on the way from one face to a neighbour, by looking at every angle."""
    nodes = SIGNS * HALF - CENTRE
    for face in die.FACES:
        paths = []
        for other in die.FACES:
            if other in (face, die.opposite(face)):
                continue
            angles = np.linspace(0, np.pi / 2, 20001)
            down = np.outer(die.NORMALS[face - 1], np.cos(angles)) + np.outer(die.NORMALS[other - 1], np.sin(angles))
            paths.append(height(down, nodes).max())
        assert die.tipping_heights(HALF, CENTRE)[face - 1] == pytest.approx(min(paths), rel=1e-8)


def test_the_face_below_is_the_one_to_which_it_rolls_downhill():
    """Steepest descent of the centre's height leads from any direction down to that face's normal."""
    random = np.random.default_rng(4)
    nodes, rest = SIGNS * HALF - CENTRE, die.rest_heights(HALF, CENTRE)
    down = random.standard_normal((200, 3))
    here = down / np.linalg.norm(down, axis=1, keepdims=True)
    for _ in range(4000):
        lowest = nodes[(here @ nodes.T).argmax(axis=1)]
        here = here - 5e-3 * (lowest - (lowest * here).sum(axis=1, keepdims=True) * here)
        here /= np.linalg.norm(here, axis=1, keepdims=True)
    faces = die.face_below(down, rest)
    np.testing.assert_array_equal((here @ die.NORMALS.T).argmax(axis=1) + 1, faces)
    assert set(faces.tolist()) == set(die.FACES)


def test_a_cube_tips_at_half_its_faces_diagonal():
    np.testing.assert_allclose(die.tipping_heights(np.full(3, 0.5), np.zeros(3)), np.sqrt(0.5))
