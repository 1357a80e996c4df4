"""The energy of two boxes that overlap: zero where they are apart, continuous, with forces that are its slopes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation
from tests.dynamics.box_contact.two_boxes import UNIT, energies, placed, stiffness

from stiffdice.dynamics.box_contact import law

DEPTH = 1e-3
ABOVE = 1.0, DEPTH  # the height at which a cube touches one below it, and how deep it is in
TILTED = math.sqrt(0.5)  # half the diagonal of a face


def turned(*rotation_vector):
    return Rotation.from_rotvec(rotation_vector)


def room_between(sides, place, turns):
    """Return the largest t such that a point is t inside both boxes; negative where they are apart."""
    rows, right = [], []
    for half, centre, turn in zip(np.array(sides) / 2, ([0, 0, 0], place), turns, strict=True):
        for normal, wide in zip(turn.as_matrix().T, half, strict=True):
            for sign in (1, -1):
                rows.append([*(sign * normal), 1])
                right.append(sign * normal @ centre + wide)
    return linprog([0, 0, 0, -1], A_ub=rows, b_ub=right, bounds=[(None, None)] * 4).x[3]


def random_boxes(count, seed, reach):
    """Return sides, places of the second box, and turns of both, for so many pairs of boxes."""
    rng = np.random.default_rng(seed)
    sides = rng.uniform(0.6, 1.6, (2, 3))
    places = rng.normal(size=(count, 3))
    places *= rng.uniform(*reach, (count, 1)) / np.linalg.norm(places, axis=1, keepdims=True)
    return sides, places, (Rotation.random(count, random_state=seed), Rotation.random(count, random_state=seed + 1))


@pytest.mark.parametrize("seed", range(3))
def test_the_energy_is_zero_exactly_where_the_boxes_are_apart(seed):
    sides, places, turns = random_boxes(80, seed, (0.6, 1.8))
    found = energies(sides, places, turns) > 0
    rooms = [room_between(sides, place, pair) for place, *pair in zip(places, *turns, strict=True)]
    assert found.tolist() == [room > 0 for room in rooms]
    assert 10 < found.sum() < 70


@pytest.mark.parametrize("seed", range(3))
def test_force_and_torque_are_the_slopes_of_the_energy(seed):
    sides, places, turns = random_boxes(60, seed, (0.6, 1.2))
    physics, states = placed(sides, places, turns)
    energy, wrenches = law.evaluate(physics, states)
    step, slopes = 1e-6, np.empty((len(places), 6))
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        ahead, behind = (energies(sides, places + sign * shift, turns) for sign in (1, -1))
        slopes[:, axis] = (behind - ahead) / (2 * step)
        ahead, behind = (
            energies(sides, places, (turns[0], Rotation.from_rotvec(sign * shift) * turns[1])) for sign in (1, -1)
        )
        slopes[:, 3 + axis] = (behind - ahead) / (2 * step)
    off = np.abs(wrenches[:, 1] - slopes).max(axis=1) / np.abs(slopes).max(axis=1).clip(1e-3)
    # A pair on the edge between two contacts has a slope on either side.
    assert (energy > 0).sum() > 30
    assert np.quantile(off, 0.95) < 1e-8


def test_all_patches_of_two_faces_are_equally_stiff():
    """Flush, shifted along an edge or across, twisted by any angle: four springs."""
    for place in ((0, 0), (1e-14, 0), (1e-3, 0), (0.3, 0), (0.3, 0.2), (1e-7, -1e-7)):
        for twist in (0, 1e-14, 1e-6, 1e-3, 0.1, 0.5, math.pi / 4, math.pi / 2):
            assert stiffness((*place, ABOVE), turned(0, 0, twist)) == pytest.approx(4, rel=1e-11)


def test_a_small_cube_on_a_large_one_is_as_stiff_as_an_equal_one():
    place = np.array([[0.1, -0.2, 0.65 - DEPTH]])
    energy = energies((UNIT, [0.3, 0.3, 0.3]), place, ([Rotation.identity()], [turned(0, 0, 0.4)]))[0]
    assert 2 * energy / DEPTH**2 == pytest.approx(4, rel=1e-11)


def test_a_node_in_a_face_is_one_spring_and_an_edge_two():
    corner = Rotation.align_vectors([[0, 0, -1]], [[1, 1, 1]])[0]
    assert stiffness((0.1, 0.2, (0.5 + math.sqrt(0.75), DEPTH)), corner) == pytest.approx(1, rel=1e-12)
    assert stiffness((0.1, 0, (0.5 + TILTED, DEPTH)), turned(math.pi / 4, 0, 0)) == pytest.approx(2, rel=1e-11)


@pytest.mark.parametrize("angle", [1, 10, 45, 90])
def test_edges_that_cross_are_as_stiff_as_a_face_at_any_angle(angle):
    """Both turned by 45° about their edges."""
    ridge, across = turned(math.pi / 4, 0, 0), turned(0, 0, math.radians(angle))
    assert stiffness((0, 0, (2 * TILTED, DEPTH)), across * ridge, ridge) == pytest.approx(4, rel=1e-8)


def line(sides, begin, end, turns, count=4001):
    """Return energies along a line, and the largest |change| that the forces at its points allow."""
    places = np.linspace(begin, end, count)
    physics, states = placed(sides, places, tuple([turn] * count for turn in turns))
    energy, wrenches = law.evaluate(physics, states)
    forces = np.abs(wrenches[:, 1, :3] @ (places[1] - places[0]))
    return energy, np.maximum(forces[1:], forces[:-1])


HAND_OVERS = {
    "a corner over the edge of a face": ((0.3, 0.1, 1.33), (0.9, 0.2, 1.33), (0.6155, 0.7854, 0)),
    "an edge over the edge of a face": ((0, 0.1, 1.2), (1.3, 0.1, 1.2), (0.7854, 0, 0.3)),
    "a face over the edge of a face": ((0, 0, 0.98), (1.1, 0.3, 0.98), (0, 0, 0.2)),
    "a face beside an equal one": ((0, -0.9, 0.99), (0, 1.1, 0.99), (0, 0, 0)),
    "an edge along an edge": ((-0.2, 0.8, 0.8), (0.2, 1.1, 0.8), (0.7854, 0, 1e-6)),
    "one box through the other": ((-1.7, 0.2, 0.1), (1.7, 0.2, 0.1), (0.2, 0.4, 0.7)),
}


@pytest.mark.parametrize("name", HAND_OVERS)
def test_the_energy_is_continuous_where_contacts_hand_over(name):
    begin, end, turn = HAND_OVERS[name]
    energy, allowed = line((UNIT, UNIT), begin, end, (Rotation.identity(), Rotation.from_rotvec(turn)))
    assert energy.max() > 1e-5
    assert (np.abs(np.diff(energy)) <= 1.05 * allowed + 1e-9 * energy.max()).all()


def test_no_work_is_done_around_a_closed_loop_of_overlaps():
    """A circle of places, with a turn there and back, through many hand-overs: the work vanishes with the step."""
    work = {}
    for count in (1_000, 16_000):
        phase = np.linspace(0, 2 * math.pi, count + 1)
        places = np.column_stack([0.45 * np.cos(phase), 0.45 * np.sin(phase), 1.2 + 0.1 * np.sin(2 * phase)])
        vectors = np.outer(0.4 * np.sin(phase), [1, 0, 0]) + np.outer(0.3 * np.cos(phase), [0, 0, 1])
        turn = Rotation.from_rotvec(vectors)
        physics, states = placed((UNIT, UNIT), places, ([Rotation.identity()] * (count + 1), turn))
        energy, wrenches = law.evaluate(physics, states)
        moved = np.column_stack([np.diff(places, axis=0), (turn[1:] * turn[:-1].inv()).as_rotvec()])
        work[count] = np.sum((wrenches[1:, 1] + wrenches[:-1, 1]) / 2 * moved) / energy.max()
    assert energy.max() > 1e-3
    assert abs(work[1_000]) < 2e-4  # of 3.5 done there and back
    assert abs(work[16_000]) < 2e-6
