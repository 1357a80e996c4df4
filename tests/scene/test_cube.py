from __future__ import annotations

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.scene.cube import LINKS, SIGNS, Cube


def test_printed_side_is_the_papers_formula():
    assert Cube(geometry="printed").side == pytest.approx(-np.sqrt(2) + 2 * np.sqrt(1.5), rel=1e-15)
    assert Cube(geometry="printed").side == pytest.approx(1.0353, abs=5e-5)


@pytest.mark.parametrize("radius", [1e-9, 0.01, 1.0, 1e9])
def test_exact_corners_lie_at_the_radius(radius):
    corners = np.linalg.norm(Cube(radius=radius, geometry="exact").node_offsets(), axis=1)
    np.testing.assert_allclose(corners, radius, rtol=1e-15)


def test_printed_corners_do_not():
    assert np.linalg.norm(Cube(geometry="printed").node_offsets()[0]) == pytest.approx(0.8966, abs=1e-4)


@pytest.mark.parametrize(("inertia", "factor"), [("solid", 1 / 6), ("corners", 1 / 2)])
def test_moment_of_inertia(inertia, factor):
    cube = Cube(radius=2, mass=3, geometry="exact", inertia=inertia)
    assert cube.moment_of_inertia == pytest.approx(factor * 3 * cube.side**2, rel=1e-15)


def test_corner_masses_have_the_corners_inertia():
    cube = Cube(mass=4, geometry="exact", inertia="corners")
    nodes = cube.node_offsets()
    about_z = np.sum(cube.mass / 8 * (nodes[:, 0] ** 2 + nodes[:, 1] ** 2))
    assert cube.moment_of_inertia == pytest.approx(about_z, rel=1e-14)


def test_links_are_the_twelve_edges():
    lengths = {np.abs(SIGNS[a] - SIGNS[b]).sum() for a, b in LINKS}
    assert len(set(LINKS)) == 12
    assert lengths == {2.0}  # ends differ along one axis only


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"radius": 0}, "cube.radius = 0"),
        ({"radius": -1}, "cube.radius = -1"),
        ({"mass": -1.0}, "cube.mass = -1.0"),
        ({"mass": float("nan")}, "cube.mass = nan"),
        ({"mass": True}, "cube.mass = True"),
        ({"geometry": "round"}, "cube.geometry = round: allowed is printed or exact"),
        ({"inertia": "hollow"}, "cube.inertia = hollow: allowed is solid or corners"),
    ],
)
def test_bad_values_are_named(values, told):
    with pytest.raises(InputError, match=told.replace(".", r"\.")):
        Cube(**values)


def test_a_printed_side_lost_to_round_off_is_refused():
    # -sqrt(2) + 2 sqrt(0.5 + r^2) is about sqrt(2) r^2 for a small r, and nothing at all in double precision.
    with pytest.raises(InputError, match="no such cube with the printed geometry"):
        Cube(radius=1e-9, geometry="printed")
