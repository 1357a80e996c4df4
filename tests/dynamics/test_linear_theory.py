from __future__ import annotations

import itertools

import numpy as np
import pytest

from stiffdice.dynamics import linear_theory
from stiffdice.scene.rotation import rotated
from stiffdice.scene.scene import Scene, from_mapping


def test_the_papers_steps_in_units_of_the_contact_frequency():
    stiff = Scene().with_ground(stiffness=1e6)
    assert linear_theory.omega_h(stiff, 10_000) == 2.0
    assert linear_theory.omega_h(stiff, 20_000) == 1.0
    assert linear_theory.steps_for(stiff, 2.0) == 10_000


def test_a_heavier_cube_bounces_more_slowly_and_more_nodes_faster():
    assert linear_theory.contact_frequency(100.0, 4.0) == 10.0
    assert linear_theory.contact_frequency(100.0, 16.0) == 5.0
    assert linear_theory.contact_frequency(100.0, 4.0, nodes=1) == 5.0


@pytest.mark.parametrize(("stiffness", "mass"), [(1e300, 1e-9), (1e-300, 1e9), (0.0, 1.0)])
def test_the_frequency_stays_in_range_where_the_quotient_does_not(stiffness, mass):
    assert np.isfinite(linear_theory.contact_frequency(stiffness, mass))


@pytest.mark.parametrize("zeta", [0.0, 1e-3, 0.2, 1.0, 3.0])
def test_the_stability_limit_is_the_formula(zeta):
    assert linear_theory.stability_limit(zeta) == pytest.approx(2 * (np.sqrt(1 + zeta**2) - zeta), rel=1e-14)


def test_the_stability_limit_keeps_its_digits_under_heavy_damping():
    """2(√(1 + ζ²) − ζ) → 1/ζ, where the formula as it is written gives zero."""
    assert linear_theory.stability_limit(1e9) == pytest.approx(1e-9, rel=1e-15)


def step_matrix(omega_h, zeta):
    """One step of the oscillator with ω = 1, on (x, v)."""
    kick = np.array([[1, 0], [-omega_h, 1 - 2 * zeta * omega_h]])
    drift = np.array([[1, omega_h], [0, 1]])
    return drift @ kick


@pytest.mark.parametrize("zeta", [0.0, 0.05, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("relative", [0.01, 0.4, 0.9, 0.99, 1.01, 1.5, 3.0])
def test_growth_is_the_spectral_radius_of_a_step(zeta, relative):
    omega_h = relative * linear_theory.stability_limit(zeta)
    radius = np.abs(np.linalg.eigvals(step_matrix(omega_h, zeta))).max()
    assert linear_theory.growth(omega_h, zeta) == pytest.approx(radius, rel=1e-12)
    assert (linear_theory.growth(omega_h, zeta) > 1) == (relative > 1)


FACE, EDGE, CORNER = [4, 5, 6, 7], [4, 5], [6]


@pytest.mark.parametrize(
    ("inertia", "touching", "numbers"),
    [
        ("solid", FACE, [0, 4, 6, 6]),
        ("corners", FACE, [0, 2, 2, 4]),
        ("solid", EDGE, [0, 0, 3, 5]),
        ("corners", EDGE, [0, 0, 1, 3]),
        ("solid", CORNER, [0, 0, 0, 4]),
        ("corners", CORNER, [0, 0, 0, 2]),
    ],
)
@pytest.mark.parametrize("geometry", ["printed", "exact"])
def test_contact_modes_of_an_upright_cube(inertia, touching, numbers, geometry):
    cube = {"radius": 0.3, "mass": 2.5, "inertia": inertia, "geometry": geometry}
    scene = from_mapping({"cube": cube, "ground": {"stiffness": 4e5}})
    found = linear_theory.contact_modes(scene, scene.cube.node_offsets(), np.array(touching)) / (4e5 / 2.5)
    np.testing.assert_allclose(found, numbers, atol=1e-12)
    mask = np.isin(np.arange(8), touching)
    np.testing.assert_allclose(
        linear_theory.contact_modes(scene, scene.cube.node_offsets(), mask) / 1.6e5, found, atol=1e-12
    )


def test_contact_modes_turn_with_cube_and_ground():
    upright, turn = Scene(), np.array([0.3, -0.8, 0.5])
    offsets = upright.cube.node_offsets()
    tilted = upright.with_ground(normal=tuple(rotated(np.array([[0.0, 0.0, 1.0]]), turn)[0]))
    for touching in (FACE, EDGE, CORNER):
        np.testing.assert_allclose(
            linear_theory.contact_modes(tilted, rotated(offsets, turn), touching),
            linear_theory.contact_modes(upright, offsets, touching),
            atol=1e-9 * upright.ground.stiffness,
        )


def test_an_edge_and_a_corner_are_stiffest_when_the_cube_is_nearly_flat():
    scene = Scene()
    unit = scene.ground.stiffness / scene.cube.mass
    for turn in itertools.product(np.linspace(-1.5, 1.5, 8), repeat=3):
        offsets = rotated(scene.cube.node_offsets(), np.array(turn))
        lowest = np.argsort(offsets[:, 2])
        assert linear_theory.contact_modes(scene, offsets, lowest[:1])[-1] < 4 * unit
    for tilt in np.linspace(0.01, np.pi / 4, 8):  # about the edge's own axis, up to balancing on it
        offsets = rotated(scene.cube.node_offsets(), np.array([0, tilt, 0]))
        assert linear_theory.contact_modes(scene, offsets, np.argsort(offsets[:, 2])[:2])[-1] < 5 * unit


@pytest.mark.parametrize("n", [2, 3, 4, 7, 12, 100])
def test_at_a_magic_step_half_a_period_is_whole_steps(n):
    """n steps of the oscillator turn any place and speed around, and no fewer do."""
    step = step_matrix(linear_theory.magic_step(n), 0.0)
    np.testing.assert_allclose(np.linalg.matrix_power(step, n), -np.eye(2), atol=1e-11)
    assert all(np.abs(np.linalg.matrix_power(step, k) + np.eye(2)).max() > 0.01 for k in range(1, n))


def test_magic_steps_are_those_within_a_span():
    assert linear_theory.magic_steps(0.5, 1.5) == {n: linear_theory.magic_step(n) for n in (2, 3, 4, 5, 6)}
    assert linear_theory.magic_steps(linear_theory.magic_step(5), linear_theory.magic_step(3)) == {
        n: linear_theory.magic_step(n) for n in (3, 4, 5)
    }
    assert list(linear_theory.magic_steps(1e-9, 2.0, most=4)) == [2, 3, 4]
    assert linear_theory.magic_steps(1.5, 1.9) == {}
    assert linear_theory.magic_step(3) == pytest.approx(1, rel=1e-15)


@pytest.mark.parametrize("omega_h", [0.01, 0.3, 1.0, 1.7, 1.99])
def test_a_bounce_cannot_gain_more_than_the_quantity_that_contact_keeps_allows(omega_h):
    """v² + ω²x(x − hv), kept by every step, is least against v² half-way, x = hv/2."""
    place, speed = np.linspace(-1, 0, 2001), 1.0
    before = place + omega_h * speed, speed - omega_h * (place + omega_h * speed)

    def kept(x, v):
        return v**2 + x * (x - omega_h * v)

    after = before[0] + omega_h * before[1], before[1]
    np.testing.assert_allclose(kept(*after), kept(before[0], speed), atol=1e-13)
    within = np.linspace(0, omega_h, 1001)
    assert 1 / kept(within, 1.0).min() == pytest.approx(linear_theory.gain_bound(omega_h), rel=1e-12)
    assert kept(within, 1.0).max() == 1


def test_the_largest_gain_comes_to_the_bound_half_way_between_magic_steps_and_to_nothing_at_them():
    for n in range(2, 40):
        between = linear_theory.magic_step(n - 0.5)
        assert linear_theory.largest_gain(between) == pytest.approx(linear_theory.gain_bound(between), rel=1e-12)
        assert linear_theory.largest_gain(linear_theory.magic_step(n)) == pytest.approx(1, rel=1e-12)
    for omega_h in np.linspace(0.01, 1.999, 500):
        assert 1 - 1e-12 <= linear_theory.largest_gain(omega_h) <= linear_theory.gain_bound(omega_h) * (1 + 1e-12)
    assert linear_theory.largest_gain(2 - 1e-9) == pytest.approx(9, rel=1e-6)


def test_a_cube_at_rest_is_held_by_four_springs():
    scene = Scene().with_ground(stiffness=50)
    assert 4 * 50 * linear_theory.sag(scene) == pytest.approx(scene.cube.mass * scene.gravity, rel=1e-15)
    assert linear_theory.sag(Scene().with_ground(stiffness=0)) == np.inf
