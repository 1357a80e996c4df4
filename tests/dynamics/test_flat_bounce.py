"""The exact bounce against theory, against an integration in 40 digits and against the project's own simulator."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiffdice.dynamics import flat_bounce
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.state import physics_of
from stiffdice.errors import InputError
from stiffdice.scene import flat_landing
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate

# All that a bounce depends on, of a cube with m = 2 kg and S = 1e4 kg/s² (ω = 141 rad/s).
MASS, STIFFNESS = 2.0, 1e4
OMEGA = math.sqrt(4 * STIFFNESS / MASS)


def scene_of(law, zeta, gravity=9.8, stiffness=STIFFNESS, mass=MASS, **ground):
    damping = zeta * math.sqrt(stiffness * mass)
    return from_mapping(
        {
            "cube": {"mass": mass},
            "ground": {"stiffness": stiffness, "damping": damping, "friction": 0, "contact": law, **ground},
            "gravity": gravity,
        }
    )


@njit
def in_a_kernel(physics, pull, speed_in):
    return flat_bounce.rebound_speed(physics, pull, speed_in)


def integrated(scene, speed):
    """Speed at lift-off, by Taylor series of the contact law's own force; 0 once the energy is too little to leave."""
    with localcontext(prec=40):
        m, g, v = Decimal(scene.cube.mass), Decimal(scene.gravity), Decimal(speed)
        return _integrated(
            scene.ground.contact, Decimal(scene.ground.stiffness), Decimal(scene.ground.damping), m, g, v
        )


def _integrated(law, stiffness, damping, m, g, v):
    step = 1 / (4 * (4 * stiffness / m).sqrt() + 32 * damping / m)
    first = step * Decimal("1e-25")  # past the event that the step starts from
    s, u, pushed, dragged = Decimal(0), -v, True, law == "ungated"

    def sides(at):
        return at[0] > 0, at[1] > 0, stiffness * at[0] + damping * at[1] < 0

    while m * u * u / 2 + m * g * s + 2 * stiffness * s * s > 0:
        terms = [s, u]
        for k in range(40):
            rate = damping * (k + 1) * terms[k + 1]
            force = -4 * pushed * (stiffness * terms[k] + rate) - 4 * dragged * rate - (m * g if k == 0 else 0)
            terms.append(force / m / ((k + 1) * (k + 2)))
        start = sides(_taylor(terms, first))
        low, high = first, step
        while high - low > first and sides(_taylor(terms, high)) != start:
            middle = (low + high) / 2
            low, high = (low, middle) if sides(_taylor(terms, middle)) != start else (middle, high)
        s, u = _taylor(terms, high)
        if s > 0:
            return float(u)
        pushed, dragged = sides((s, u))[2], law == "ungated" and u < 0
    return 0.0


def _taylor(terms, t):
    s = u = Decimal(0)
    for term in reversed(terms):
        u = u * t + s
        s = s * t + term
    return s, u


@pytest.mark.parametrize("zeta", [*np.linspace(0, 3, 31), 0.7071, 1 - 2**-53, 1 + 1e-9, 50.0, 1e6])
def test_without_gravity_the_laws_have_closed_forms(zeta):
    """Half of a gated bounce's loss is on the way in, where the ungated law damps twice as much."""
    for law in CONTACT_LAWS:
        closed = math.exp(-flat_landing.loss(law, zeta))
        assert flat_bounce.restitution(scene_of(law, zeta, gravity=0), 3.0) == pytest.approx(closed, rel=1e-13)


# Speeds in units of g/ω, which is what the weight adds in 1/ω: below about 1 it decides.
BOUNCES = [
    *[(zeta, speed) for zeta in (1e-6, 0.03) for speed in (1e3, 3.0, 1.0)],
    *[(zeta, speed) for zeta in (0.5, 1.0 - 1e-7, 1.2) for speed in (1e3, 100.0)],
    *[(1e-12, 1e-3), (1e-6, 1 / 30), (0.01, 1 / 2), (1.0, 300.0), (3.0, 1000.0), (10.0, 1e6)],
]


@pytest.mark.parametrize(("zeta", "speed"), BOUNCES)
@pytest.mark.parametrize("law", CONTACT_LAWS)
@pytest.mark.long
def test_a_bounce_against_an_integration_of_the_force(law, zeta, speed):
    scene = scene_of(law, zeta)
    speed_in = speed * 9.8 / OMEGA
    expected = integrated(scene, speed_in) / speed_in
    assert 0 < expected < 1
    assert flat_bounce.restitution(scene, speed_in) == pytest.approx(expected, rel=1e-13)


def slowest(scene):
    """The speed below which the cube stays, by bisection."""
    low, high = 1e-9, 1e6
    while high / low > 1 + 1e-13:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if flat_bounce.restitution(scene, middle) > 0 else (middle, high)
    return high


@pytest.mark.parametrize("zeta", [1e-3, 0.1, 0.45, 0.7, 1.1])
@pytest.mark.parametrize("law", CONTACT_LAWS)
def test_the_ground_keeps_a_cube_that_comes_in_slower_than_it_should(law, zeta):
    scene = scene_of(law, zeta)
    limit = slowest(scene)
    assert integrated(scene, limit * (1 + 1e-9)) > 0
    assert integrated(scene, limit * (1 - 1e-9)) == 0
    assert flat_bounce.restitution(scene, limit / 2) == 0
    assert flat_bounce.restitution(scene, limit / 1e6) == 0


@pytest.mark.parametrize("law", CONTACT_LAWS)
def test_the_simulator_converges_to_it(law):
    """From touch-down to the first step above the ground, and back to the surface along the parabola."""
    zeta, speed_in = 0.1, 10 * 9.8 / OMEGA
    still = scene_of(law, zeta)
    launch = {"position": [0, 0, still.cube.side / 2], "velocity": [0, 0, -speed_in]}
    scene = from_mapping({**still.as_mapping(), "launch": launch, "duration": 5 / OMEGA})
    expected = flat_bounce.restitution(scene, speed_in)

    def error(steps):
        state = simulate(scene, model="sliding", steps=steps, every=1).trajectory.state
        clearance = state["position"][:, 2] - scene.cube.side / 2
        first = np.flatnonzero(clearance[1:] > 0)[0] + 1
        leaving = math.sqrt(state["velocity"][first, 2] ** 2 + 2 * 9.8 * clearance[first])
        return abs(leaving / speed_in - expected)

    errors = [error(steps) for steps in (500, 5_000, 50_000)]
    assert errors[0] < 0.01
    assert errors[1] < 0.2 * errors[0]
    assert errors[2] < 0.2 * errors[1]


def test_only_gravity_along_the_normal_counts():
    slope = scene_of("gated", 0.1, normal=[3, 0, 4])
    assert flat_bounce.restitution(slope, 0.3) == pytest.approx(
        flat_bounce.restitution(scene_of("gated", 0.1, gravity=9.8 * 0.8), 0.3), rel=1e-14
    )
    assert flat_bounce.restitution(slope, 0.3) > flat_bounce.restitution(scene_of("gated", 0.1), 0.3)


laws = st.sampled_from(list(CONTACT_LAWS))
sizes = st.floats(-9, 16).map(lambda exponent: 10**exponent)
masses = st.floats(-9, 9).map(lambda exponent: 10**exponent)
any_size = st.one_of(st.just(0.0), st.floats(0, 1e300), st.floats(-300, 300).map(lambda exponent: 10**exponent))


@given(laws, sizes, masses, any_size, sizes)
def test_without_damping_no_speed_is_lost(law, stiffness, mass, gravity, speed_in):
    assert flat_bounce.restitution(scene_of(law, 0, gravity, stiffness, mass), speed_in) == 1


@given(laws, any_size, masses, any_size, any_size.filter(bool))
def test_what_does_not_spring_does_not_come_back(law, damping, mass, gravity, speed_in):
    scene = scene_of(law, 0, gravity, 0, mass).with_ground(damping=damping)
    assert flat_bounce.restitution(scene, speed_in) == 0


@given(laws, st.floats(0, 5), st.floats(0, 5), sizes, masses, any_size, sizes)
def test_more_damping_leaves_less(law, one, other, stiffness, mass, gravity, speed_in):
    less, more = sorted((one, other))
    high, low = (
        flat_bounce.restitution(scene_of(law, zeta, gravity, stiffness, mass), speed_in) for zeta in (less, more)
    )
    assert 0 <= low <= high * (1 + 1e-12)
    assert high <= 1


@given(laws, st.floats(0, 2), st.floats(0.01, 1e3), st.floats(0.01, 1e3))
def test_a_faster_cube_keeps_more_of_its_speed(law, zeta, one, other):
    slow, fast = sorted((one, other))
    scene = scene_of(law, zeta)
    assert flat_bounce.restitution(scene, slow) <= flat_bounce.restitution(scene, fast) * (1 + 1e-12)


@given(laws, any_size, any_size, st.floats(1e-300, 1e300), any_size, any_size.filter(bool))
def test_any_finite_scene_has_an_answer(law, stiffness, damping, mass, gravity, speed_in):
    scene = scene_of(law, 0, gravity, mass=mass).with_ground(stiffness=stiffness, damping=damping)
    assert 0 <= flat_bounce.restitution(scene, speed_in) <= 1


@pytest.mark.parametrize("law", CONTACT_LAWS)
def test_a_kernel_may_ask_whatever_state_it_is_in(law):
    scene = scene_of(law, 0.1)
    physics = physics_of(scene)
    assert in_a_kernel(physics, 9.8, 0.7) == flat_bounce.restitution(scene, 0.7) * 0.7
    assert in_a_kernel(physics, 9.8, 0.0) == 0
    assert in_a_kernel(physics, 9.8, -1.0) == 0
    for key in ("stiffness", "damping", "mass"):
        assert math.isnan(in_a_kernel(physics._replace(**{key: math.nan}), 9.8, 0.7))
    assert math.isnan(in_a_kernel(physics, math.nan, 0.7))
    assert math.isnan(in_a_kernel(physics, 9.8, math.nan))
    assert math.isnan(in_a_kernel(physics, -9.8, 0.7))  # a ceiling


@pytest.mark.parametrize("speed_in", [0.0, -1.0, math.nan, math.inf])
def test_a_cube_that_does_not_come_in_has_no_restitution(speed_in):
    with pytest.raises(InputError, match=r"speed_in = .*> 0 \[m/s\]"):
        flat_bounce.restitution(scene_of("gated", 0.1), speed_in)


def test_a_ceiling_is_refused():
    with pytest.raises(InputError, match=r"ground.normal\[z\] = -1"):
        flat_bounce.restitution(scene_of("gated", 0.1, normal=[0, 0, -1]), 1.0)
