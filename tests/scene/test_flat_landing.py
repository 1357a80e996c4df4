"""A flat landing's closed form against the paper it is from, and against runs of the grounds that it gives."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiffdice.integrators.exact.oscillator import Oscillator, after
from stiffdice.scene import flat_landing
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate

laws = st.sampled_from(sorted(CONTACT_LAWS))


def restitution_of(law, zeta):
    return math.exp(-flat_landing.loss(law, zeta))


def schwager_poeschel(zeta):
    """As published, with ω = 1: β = ζ, ω_d² = 1 − ζ² (doi:10.1007/s10035-007-0065-z)."""
    rate = np.sqrt(abs(1 - zeta**2))
    if zeta > 1:
        return np.exp(-zeta / rate * np.log((zeta + rate) / (zeta - rate)))
    angle = np.arctan(2 * zeta * rate / (rate**2 - zeta**2))
    return np.exp(-zeta / rate * (np.pi - angle if zeta < np.sqrt(0.5) else -angle))


@pytest.mark.parametrize("zeta", [0.0, 1e-6, 0.1, 0.5, 0.7071, 0.7072, 0.9, 0.999, 1.001, 1.5, 3.0])
def test_restitution_is_schwager_and_poeschels_on_all_branches(zeta):
    assert restitution_of("gated", zeta) == pytest.approx(schwager_poeschel(zeta), rel=1e-12)


@pytest.mark.parametrize("zeta", [1 - 2**-53, 1.0, 1 + 2**-52, 1 - 1e-12, 1 + 1e-12])
def test_restitution_is_smooth_at_critical_damping(zeta):
    assert restitution_of("gated", zeta) == pytest.approx(np.exp(-2), rel=1e-11)


@pytest.mark.parametrize("zeta", [1e4, 1e100])
def test_a_heavily_damped_bounce_keeps_a_quarter_of_the_inverse_square(zeta):
    assert restitution_of("gated", zeta) == pytest.approx(1 / (4 * zeta * zeta), rel=1e-6)


@given(laws, st.floats(0, 1, exclude_min=True))
def test_the_damping_ratio_of_a_restitution_has_it(law, restitution):
    zeta = flat_landing.damping_ratio(law, restitution)
    # As precise as the logarithm is: of one part in 1e300 it is good to 700 units in the last place.
    wanted = pytest.approx(restitution, rel=1e-15 * (2 - math.log(restitution)), abs=5e-324)
    assert restitution_of(law, zeta) == wanted


def test_a_ground_that_keeps_all_the_speed_has_no_damping():
    assert all(flat_landing.damping_ratio(law, 1.0) == 0 for law in CONTACT_LAWS)
    assert all(flat_landing.duration(law, 0.0) == math.pi for law in CONTACT_LAWS)


@given(laws, st.floats(0.01, 1), st.floats(1e-6, 1), st.floats(1e-3, 1e3))
@pytest.mark.long
def test_a_ground_of_a_contact_time_pushes_for_so_long(law, restitution, contact_time, mass):
    """Followed along the oscillator of each leg: at the end it neither pushes nor pulls, at e times the speed."""
    stiffness = flat_landing.stiffness(law, restitution, contact_time, mass)
    damping = flat_landing.damping(law, restitution, stiffness, mass)
    omega, beta = 2 * math.sqrt(stiffness / mass), 2 * damping / mass
    approach = CONTACT_LAWS[law].approach_damping * beta
    turn = flat_landing.leg(approach / omega) / omega
    depth, speed = after(Oscillator(omega, approach, 0.0, -1.0), turn)
    assert speed == pytest.approx(0, abs=1e-12)
    # From the turn on, forwards: z = depth·(s' + 2βs), the response to a start at a depth.
    rest = contact_time - turn
    s, slope = after(Oscillator(omega, beta, 0.0, 1.0), rest)
    leaving = -depth * omega * omega * s
    assert leaving == pytest.approx(restitution, rel=1e-9)
    force = stiffness * -depth * (slope + 2 * beta * s) - damping * leaving
    assert force == pytest.approx(0, abs=1e-9 * stiffness * -depth)


def measured(scene, scheme):
    """Return speed up, at the height of the ground, over speed down of a cube that is launched at the ground."""
    run = simulate(scene, model="sliding", scheme=scheme, steps=1000, every=1, tolerance=1e-12)
    low = run.trajectory.state["position"][:, 2] - scene.cube.side / 2
    speed = run.trajectory.state["velocity"][:, 2]
    up = np.argmax((speed > 0) & (low > 0))
    return np.sqrt(speed[up] ** 2 + 2 * scene.gravity * low[up]) / -speed[0]


@pytest.mark.parametrize("law", sorted(CONTACT_LAWS))
@pytest.mark.parametrize("restitution", [0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 1.0])
@pytest.mark.parametrize("ground", [{"contact_time": 1e-7}, {"stiffness": 1e14}], ids=["contact_time", "stiffness"])
def test_a_run_has_the_restitution_that_was_asked_for(law, restitution, ground):
    """On a ground so stiff that gravity, which the closed form leaves out, takes less than a thousandth."""
    scene = from_mapping(
        {
            "preset": "as_written",
            "cube": {"side": 0.5},
            "ground": {"restitution": restitution, "contact": law, "friction": 0, **ground},
            "launch": {"position": [0, 0, 0.25], "velocity": [0, 0, -5]},
            "duration": 0.01,
        }
    )
    assert measured(scene, "exact") == pytest.approx(restitution, abs=1e-3)
    assert measured(scene, "event") == pytest.approx(restitution, abs=1e-3)


@pytest.mark.parametrize("law", sorted(CONTACT_LAWS))
@pytest.mark.parametrize("restitution", [0.01, 0.1, 0.2, 0.3, 0.5, 0.9, 1.0])
def test_depth_and_force_are_the_largest_of_the_oscillator(law, restitution):
    """Followed along the way in; on the way out the cube is nearer and the force less."""
    speed, zeta = 3.0, flat_landing.damping_ratio(law, restitution)
    approach = CONTACT_LAWS[law].approach_damping * zeta
    times = np.linspace(0, flat_landing.leg(approach), 1001)
    places, speeds = np.array([after(Oscillator(1.0, approach, 0.0, -speed), time) for time in times]).T
    assert flat_landing.depth(law, zeta) * speed == pytest.approx(-places.min(), rel=1e-5)
    largest = (-places - 2 * approach * speeds).max()
    assert flat_landing.peak_force(law, zeta) * speed == pytest.approx(largest, rel=1e-5)


@given(laws, st.floats(0.05, 0.99), st.floats(1e-5, 1e-2), st.floats(0.01, 10), st.floats(1e-3, 1))
def test_a_ground_of_a_depth_is_that_of_its_contact_time(law, restitution, deepest, speed, mass):
    stiffness = flat_landing.stiffness_of_depth(law, restitution, deepest, speed, mass)
    zeta = flat_landing.damping_ratio(law, restitution)
    omega = 2 * math.sqrt(stiffness / mass)
    assert flat_landing.depth(law, zeta) * speed / omega == pytest.approx(deepest, rel=1e-12)
    same = flat_landing.stiffness(law, restitution, flat_landing.duration(law, zeta) / omega, mass)
    assert same == pytest.approx(stiffness, rel=1e-12)
