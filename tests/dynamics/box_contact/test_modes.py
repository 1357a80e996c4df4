from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.box_contact import modes
from stiffdice.dynamics.box_contact.pair_state import pair_physics_of, pair_start_of
from stiffdice.dynamics.state import edges_of
from stiffdice.scene.pair import from_mapping
from stiffdice.scene.rotation import rotated
from stiffdice.simulation.pair.energy import energies

S, MASS, SIDE = 1e4, 2.0, 1.0
UP = np.array([0.0, 0.0, 1.0])
DEEP = 1e-5
TILTED = np.arccos(1 / np.sqrt(3)) / np.sqrt(2)  # about (1, −1, 0) it puts a node below the centre
ORIENTATIONS = {
    "flush": ([0, 0, 0], [0, 0, 0], 0.5, 0.5),
    "twisted": ([0, 0, 0], [0, 0, 0.5], 0.5, 0.5),
    "edges": ([np.pi / 4, 0, 0], [0, np.pi / 4, 0], np.sqrt(0.5), np.sqrt(0.5)),
    "skew edges": ([np.pi / 4, 0, 0], [-np.pi / 8, np.pi / 8, 0.9], np.sqrt(0.5), None),
    "corner": ([0, 0, 0], [TILTED, -TILTED, 0], 0.5, np.sqrt(0.75)),
}


def scene_of(below=(0, 0, 0), above=(0, 0, 0), mass=MASS, at=100.0, gap=1.0, shift=(0.0, 0.0), sides=None):
    size = {"side": SIDE} if sides is None else {"sides": sides}
    cubes = [
        {"cube": {**size, "mass": m}, "launch": {"position": place, "velocity": [0, 0, 0], "orientation": list(turn)}}
        for m, turn, place in ((MASS, below, [0, 0, at]), (mass, above, [*shift, at + gap]))
    ]
    return from_mapping({"cubes": cubes, "ground": {"stiffness": S, "damping": 0, "friction": 0}, "gravity": 0})


def overlapping(name, shift=(0.0, 0.0), mass=MASS, deep=DEEP):
    below, above, low, high = ORIENTATIONS[name]
    scene = scene_of(below, above, mass)
    if high is None:
        high = -(pair_start_of(scene)[0]["b"]["node_offset"][:, 2]).min()
    scene = scene_of(below, above, mass, gap=low + high - deep, shift=shift)
    return scene, pair_start_of(scene)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.3, 0.0), (-0.2, 0.45)])
@pytest.mark.parametrize("twist", [0.0, 0.3, np.pi / 4])
def test_flush_cubes_are_equally_stiff_whatever_their_offset_and_twist(shift, twist):
    scene = scene_of(above=[0, 0, twist], gap=SIDE - DEEP, shift=shift)
    found = modes.translations(scene, pair_start_of(scene), UP)
    np.testing.assert_allclose(found * MASS / S, [0, 8], rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("mass", [MASS, 0.1, 30.0])
@pytest.mark.parametrize(("name", "nodes"), [("flush", 4), ("twisted", 4), ("edges", 4), ("corner", 1)])
def test_compression_of_central_contacts_is_a_mode_of_the_reduced_mass(name, nodes, mass):
    scene, pair = overlapping(name, mass=mass)
    wanted = nodes * S * (1 / MASS + 1 / mass)
    np.testing.assert_allclose(modes.translations(scene, pair, UP)[1], wanted, rtol=1e-10)
    # A contact of two edges is beside the line of the centres by part of its depth, whose square turns the boxes.
    assert np.abs(modes.squares(scene, pair) / wanted - 1).min() < 10 * DEEP**2


def test_flush_cubes_rock_faster_than_they_bounce():
    """Each of two rocking modes: the springs' S s² on half of m s²/6."""
    squares = modes.squares(*overlapping("flush")) * MASS / S
    np.testing.assert_allclose(squares, [*[0] * 9, 8, 12, 12], atol=1e-9)


def stacked(twist):
    scene = scene_of(at=SIDE / 2 - DEEP, gap=SIDE - DEEP, above=[0, 0, twist])
    return scene, pair_start_of(scene)


def test_a_stack_on_the_ground_has_the_modes_of_two_masses_on_two_springs():
    squares = modes.squares(*stacked(0.0)) * MASS / S
    bounce, rocking = (6 - 20**0.5, 6 + 20**0.5), (9 - 45**0.5, 9 + 45**0.5)
    np.testing.assert_allclose(squares[:6], 0, atol=1e-9)
    np.testing.assert_allclose(squares[6:], sorted([*bounce, *rocking, *rocking]), rtol=1e-4)
    np.testing.assert_allclose(modes.translations(*stacked(0.0), UP) * MASS / S, bounce, rtol=1e-12)


def test_a_twisted_stack_bounces_as_a_flush_one_and_rocks_more_slowly():
    """The corners of the patch in which it stands are nearer to its centre."""
    flush, twisted = (modes.squares(*stacked(twist)) * MASS / S for twist in (0.0, 0.4))
    for square in (6 - 20**0.5, 6 + 20**0.5):
        assert np.abs(twisted - square).min() < 1e-9
    assert twisted[-1] < 0.8 * flush[-1]


def moved(scene, pair, coordinates):
    """The pair after small displacements weighted by √M, shape (12,)."""
    found = pair.copy()
    for k, (name, cube) in enumerate(zip("ab", scene.cubes, strict=True)):
        part = coordinates[6 * k : 6 * k + 6]
        nodes = pair[name][0]["node_offset"]
        axes = edges_of(cube, nodes)
        tensor = axes.T @ cube.distribution.tensor @ axes
        found[name]["position"][0] += part[:3] / np.sqrt(cube.mass)
        found[name]["node_offset"][0] = rotated(nodes, np.linalg.cholesky(np.linalg.inv(tensor)) @ part[3:])
    return found


def hessian(scene, pair, size):
    """Of all springs' energy by the coordinates weighted by √M, shape (12, 12)."""
    physics, steps = pair_physics_of(scene), size * np.eye(12)

    def energy(coordinates):
        return energies(physics, moved(scene, pair, coordinates), 0.0)[2:4, 0].sum()

    found = np.empty((12, 12))
    for i, j in np.ndindex(12, 12):
        a, b = steps[i], steps[j]
        found[i, j] = energy(a + b) - energy(a - b) - energy(b - a) + energy(-a - b)
    return found / (4 * size**2)


@pytest.mark.parametrize(
    "case", [*ORIENTATIONS, "shifted", "on the ground", pytest.param("boxes", marks=pytest.mark.long)]
)
def test_modes_are_those_of_the_energys_hessian(case):
    """The energy has no term of contact area or edge length: what the modes leave out is smaller by depth over side."""
    if case in ORIENTATIONS:
        scene, pair = overlapping(case, mass=0.5)
    elif case == "shifted":
        scene, pair = overlapping("twisted", shift=(0.31, -0.17))
    else:
        sides = [0.6, 1.4, SIDE] if case == "boxes" else None
        scene = scene_of(at=SIDE / 2 - DEEP, gap=SIDE - DEEP, above=[0, 0, 0.4], shift=(0.1, 0.05), sides=sides)
        pair = pair_start_of(scene)
    found = hessian(scene, pair, DEEP / 20)
    rows = modes.rows(scene, pair)
    np.testing.assert_allclose(found, rows.T @ rows, rtol=0, atol=1e-3 * np.abs(rows.T @ rows).max())
    measured = np.linalg.eigvalsh(found)[-1]
    np.testing.assert_allclose(measured, modes.squares(scene, pair)[-1], rtol=1e-3)


def test_boxes_that_are_apart_have_no_modes():
    scene = scene_of(gap=SIDE + DEEP)
    np.testing.assert_array_equal(modes.squares(scene, pair_start_of(scene)), 0)
