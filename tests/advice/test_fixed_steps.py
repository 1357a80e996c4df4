from __future__ import annotations

import pytest
from tests.advice.problems import scene

from stiffdice.advice.pilot import SAMPLES, curve, flown, tried
from stiffdice.advice.recommend import advise
from stiffdice.advice.result import EXTRAPOLATED, MEASURED, check, run_advised


@pytest.mark.parametrize(
    ("scheme", "stiffness", "budget"),
    [("symplectic_euler", 1e4, 1_000), ("symplectic_euler", 1e6, 400), ("rk4", 1e6, 150)],
)
@pytest.mark.long
def test_extrapolated_steps_keep_the_error_too(scheme, stiffness, budget):
    """What a few short runs foresee, long ones do."""
    problem = scene(duration=2.0, stiffness=stiffness)
    option = advise(problem, 1e-3, scheme=scheme, budget=budget).options[0]
    assert option.basis == EXTRAPOLATED
    assert option.error <= 1e-3
    pilot = flown(problem)
    run = tried(problem, pilot.model, scheme, option.steps)
    assert run.computed > budget
    assert pilot.error(run)[-1] <= 1e-3


@pytest.mark.long
def test_a_measured_fixed_step_is_its_own_error():
    problem = scene(stiffness=100)
    advice = advise(problem, 0.05, scheme="rk4")
    option = advice.best
    assert option.basis == MEASURED
    pilot = flown(problem)
    run = run_advised(advice, option)
    kept = run.trajectory.step % (run.steps // SAMPLES) == 0
    off = curve(run.trajectory.state["position"][kept], pilot.best.places, 1.0)[-1]
    assert off == pytest.approx(option.error, rel=1e-3)
    assert check(advice, run).kept
