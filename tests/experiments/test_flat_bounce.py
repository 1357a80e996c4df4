from __future__ import annotations

import math

import pytest

from stiffdice.dynamics import flat_bounce, linear_theory
from stiffdice.errors import InputError
from stiffdice.experiments.engines import bounce, flat
from stiffdice.experiments.placement import landing_speed
from stiffdice.scene.scene import Scene

SCENE = flat(Scene(), damping=0.0, friction=0.0)
OMEGA = linear_theory.contact_frequency(SCENE.ground.stiffness, SCENE.cube.mass)
SPEED = landing_speed(SCENE)


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.9])
def test_a_short_step_finds_the_exact_bounce(phase):
    found = bounce("symplectic_euler", SCENE, SPEED, 1e-3 / OMEGA, phase)
    # A step counts, and touch-down and lift-off are half a step late or early each, by the phase.
    assert found.restitution == pytest.approx(1, abs=1e-6)
    assert found.contact_time * OMEGA == pytest.approx(math.pi + 2 * math.atan(9.8 / (OMEGA * SPEED)), rel=1e-6)
    damped = SCENE.with_ground(damping=10.0)
    wanted = flat_bounce.restitution(damped, SPEED)
    assert wanted < 0.8
    assert bounce("symplectic_euler", damped, SPEED, 1e-3 / OMEGA, phase).restitution == pytest.approx(wanted, rel=1e-3)


def test_friction_takes_mu_times_the_normal_impulse_and_leaves_the_bounce():
    rough = SCENE.with_ground(friction=0.075)
    smooth, found = (bounce("symplectic_euler", scene, SPEED, 0.02 / OMEGA, 0.5) for scene in (SCENE, rough))
    assert found.slowed == pytest.approx(0.075, rel=1e-5)
    assert (smooth.slowed, found.restitution) == (0.0, smooth.restitution)


def test_gains_are_those_of_theory_at_the_worst_phase():
    fast = SCENE.with_ground(stiffness=1e6)
    for omega_h in (0.3, math.sqrt(3)):
        found = bounce("symplectic_euler", fast, SPEED, omega_h / (10 * OMEGA), 0.0)
        assert found.restitution**2 == pytest.approx(linear_theory.largest_gain(omega_h), rel=5e-3)


def test_long_implicit_steps_leave_the_cube_on_the_ground():
    stiff = SCENE.with_ground(stiffness=1e6)
    found = bounce("implicit_euler", stiff, SPEED, 15 / (10 * OMEGA), 0.3)
    assert found.outcome == "stays"
    assert math.isnan(found.restitution)


def test_a_ground_that_cannot_carry_the_cube_lets_it_sink():
    assert (
        bounce("symplectic_euler", SCENE.with_ground(stiffness=1.0, damping=5.0), SPEED, 0.02, 0.0).outcome == "sinks"
    )


def test_a_run_that_leaves_the_range_of_doubles_blows_up():
    endless = SCENE.with_ground(damping=1e308)
    assert bounce("symplectic_euler", endless, SPEED, 1.0 / OMEGA, 0.0).outcome == "blows_up"


def test_a_step_as_long_as_the_fall_is_refused():
    with pytest.raises(InputError, match="too long"):
        bounce("symplectic_euler", SCENE, SPEED, 1.0, 0.0)
