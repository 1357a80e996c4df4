from __future__ import annotations

import math
from dataclasses import replace

import pytest

from stiffdice.simulation.engines.mjcf.law import Law

FLAT = (0.9, 0.9, 0.001, 0.5, 2.0)
LAW = Law((-1e4, -20.0), FLAT, 1.0, 0.0, 2.0, True, 1e-4)


@pytest.mark.parametrize(
    "solref", [(-1e4, -2.0), (-1e4, -60.0), (-1e4, -190.0), (0.02, 0.05), (0.02, 0.7), (0.01, 1.5)]
)
@pytest.mark.parametrize("softness", [1.0, 0.3])
def test_a_bounce_in_short_steps_is_the_closed_form(solref, softness):
    law = replace(LAW, solref=solref, softness=softness)
    short = law.at(1e-3 / law.frequency(0.0))
    mean = sum(short.bounce(1.0, (k + 0.5) / 8 * short.timestep)[0] for k in range(8)) / 8
    assert mean == pytest.approx(law.restitution(0.0), abs=1e-3)


@pytest.mark.parametrize("rk4", [False, True])
def test_without_damping_a_bounce_keeps_its_energy_and_its_depth_is_speed_over_omega(rk4):
    law = replace(LAW, solref=(-1e4, 0.0), rk4=rk4)
    short = law.at(1e-4)
    restitution, depth = short.bounce(1.0, 0.5e-4)
    assert restitution == pytest.approx(1.0, abs=1e-3 if rk4 else 0.01)
    assert depth == pytest.approx(1.0 / law.frequency(0.0), rel=1e-3)


def test_omega_and_zeta_of_the_standard_form_are_timeconst_and_dampratio():
    """Of a contact whose W is its A: 1/(timeconst·dampratio), and dampratio, at d = dmax."""
    law = replace(LAW, solref=(0.02, 0.4))
    assert law.frequency(0.0) == pytest.approx(1 / (0.02 * 0.4))
    assert law.damping_ratio(0.0) == pytest.approx(0.4)


def test_stiffness_and_damping_of_the_direct_form_are_its_numbers_by_mass():
    assert LAW.stiffness(0.0) == pytest.approx(2.0 * 1e4)
    assert LAW.damping(0.0) == pytest.approx(2.0 * 20.0)


def test_a_body_rests_where_the_law_says():
    law = replace(LAW, solref=(-1e4, -150.0), pull=9.81, solimp=(0.6, 0.9, 0.002, 0.5, 2.0))
    clearance, rate = 0.0, 0.0
    for _ in range(20_000):
        clearance, rate = law.step(clearance, rate)
    assert -clearance == pytest.approx(law.rest_depth(), rel=1e-9)


def test_impedance_is_dmin_at_the_surface_half_way_at_the_midpoint_and_dmax_from_the_width_on():
    law = replace(LAW, solimp=(0.2, 0.8, 0.01, 0.5, 3.0))
    assert [law.impedance(depth) for depth in (0.0, 0.005, 0.01, 1.0)] == pytest.approx([0.2, 0.5, 0.8, 0.8])


def test_refsafe_makes_a_contact_as_slow_as_two_steps():
    law = replace(LAW, solref=(0.001, 1.0))
    assert (law.at(0.0005).timeconst, law.at(0.0005).is_slowed) == (0.001, False)
    assert (law.at(0.002).timeconst, law.at(0.002).is_slowed) == (0.004, True)
    assert replace(law, refsafe=False).at(0.002).timeconst == 0.001
    assert not LAW.at(1.0).is_slowed


def test_a_step_beyond_the_linear_limit_gains_energy():
    law = replace(LAW, solref=(-1e4, -2.0))
    assert law.at(2.5 / law.frequency(0.0)).bounce(1.0, 1e-3)[0] > 1.2


def test_a_heavily_damped_body_stays_down():
    assert replace(LAW, solref=(-1e4, -300.0), pull=9.81).bounce(0.1, 1e-6)[0] == 0.0
    assert math.isinf(replace(LAW, solref=(0.0, -300.0), pull=9.81).rest_depth())
