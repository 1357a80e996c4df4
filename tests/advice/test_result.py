from __future__ import annotations

import dataclasses

import pytest
from tests.advice.problems import held, scene

from stiffdice.advice.pilot import SAMPLES, curve
from stiffdice.advice.recommend import advise
from stiffdice.advice.result import check, run_advised
from stiffdice.integrators import registry as schemes
from stiffdice.simulation.run import simulate


def test_a_false_promise_is_found_broken():
    advice = advise(scene(), 1e-6, scheme="event")
    coarse = dataclasses.replace(advice.best, tolerance=0.1)
    found = check(advice, run_advised(advice, coarse))
    assert not found.kept
    fixed = dataclasses.replace(advice.best, scheme="symplectic_euler", tolerance=None, steps=50 * SAMPLES)
    assert not check(advice, run_advised(advice, fixed)).kept


def off_scipy(advice, run):
    """Return how far a run is off SciPy's LSODA at the finest tolerance [radii]."""
    kept = run.trajectory.step % (run.steps // SAMPLES) == 0
    theirs = simulate(
        advice.scene, model=advice.model, simulator="scipy", tolerance=schemes.FINEST, steps=SAMPLES, every=1
    ).trajectory.state["position"]
    return curve(run.trajectory.state["position"][kept], theirs, advice.scene.cube.radius)[-1]


@pytest.mark.parametrize("error", [1e-8, 1e-7, 1e-5])
@pytest.mark.long
def test_what_is_promised_where_friction_holds_is_true_by_another_method(error):
    """Twins of one method share its error: LSODA found 3.6e-8 where they found 6e-10."""
    advice = advise(held(), error, scheme="event")
    run = run_advised(advice, advice.best)
    found = check(advice, run)
    truth = off_scipy(advice, run)
    assert truth <= error
    assert truth <= advice.best.error + advice.floor
    assert truth <= found.found * (1 + 1e-9)
    assert found.kept
    assert "SciPy's LSODA" in advice.best.evidence
    assert "lsoda at tolerance 1e-13" in found.against
