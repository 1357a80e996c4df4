from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError
from stiffdice.experiments.work_precision.measure import (
    ALL,
    COARSE,
    FINE,
    LONGEST,
    STEPPING,
    Effort,
    chosen_from,
    fixed_step,
    ladder,
    lag_time,
    methods_for,
    path_of,
    plain,
)
from stiffdice.experiments.work_precision.problems import PROBLEMS, SAMPLES, scene_of
from stiffdice.integrators.registry import SCHEMES
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.engines.registry import SOLVERS

BASE = from_mapping({"launch": {"angular_momentum": [0.3, 0.5, 0.2]}, "duration": 3.0}, "as_written")
FLAT = PROBLEMS["flat-bounce"]


def test_every_scheme_and_every_solver_is_tried():
    assert methods_for(FLAT) == [*SCHEMES, *SOLVERS]
    assert chosen_from(FLAT, [ALL]) == methods_for(FLAT)
    assert chosen_from(FLAT, ["scipy_lsoda"]) == ["scipy_lsoda"]
    assert set(SOLVERS) <= set(methods_for(PROBLEMS["tumbling-throw"]))


@pytest.mark.parametrize("stiffness", [1e2, 1e7])
def test_a_fixed_steps_ladder_goes_from_the_limit_to_ever_more_steps(stiffness):
    scene = scene_of(FLAT, BASE, stiffness)
    steps = [effort.steps for effort in ladder(scene, "symplectic_euler", 2, 1e9)]
    assert all(count % SAMPLES == 0 for count in steps)
    assert 0.5 * LONGEST < linear_theory.omega_h(scene, steps[0]) <= LONGEST
    assert 1e9 / 10 < steps[-1] <= 1e9
    ratios = [b / a for a, b in itertools.pairwise(steps[2:])]
    np.testing.assert_allclose(ratios, math.sqrt(10), rtol=0.1)


def test_a_tolerances_ladder_is_walked_whole():
    rungs = list(ladder(BASE, "scipy_lsoda", 1, 0))
    assert [rung.tolerance for rung in rungs] == [10.0**-k for k in range(2, 13)]
    assert (rungs[0].tolerance, rungs[-1].tolerance) == (COARSE, FINE)
    assert all(rung.steps == 0 for rung in rungs)
    assert not fixed_step("scipy_lsoda")
    assert fixed_step("symplectic_euler")


@pytest.mark.parametrize("problem", PROBLEMS)
def test_flights_taken_at_once_change_no_more_than_round_off(problem):
    chosen = PROBLEMS[problem]
    scene = scene_of(chosen, BASE, 1e4)
    effort = Effort(12_000, math.nan)
    leaped = path_of(chosen, scene, "symplectic_euler", effort, 10**6)
    stepped = plain(chosen, scene, "symplectic_euler", effort)()()
    np.testing.assert_allclose(leaped.states["position"], stepped.states["position"], rtol=0, atol=1e-9)
    assert leaped.evaluations == stepped.evaluations == 12_000
    assert leaped.computed < 6_000


def test_an_engine_named_goes_up_the_ladder_of_a_fixed_step():
    """And is not tried unasked; a lagging velocity is known to lag."""
    scene, effort = scene_of(FLAT, BASE, 100), Effort(120, math.nan)
    assert chosen_from(FLAT, ["numpy", "rk4"]) == ["numpy", "rk4"]
    assert not set(STEPPING) & set(methods_for(FLAT))
    with pytest.raises(InputError, match="methods = scipy: allowed is symplectic_euler or"):
        chosen_from(FLAT, ["scipy"])
    assert [*ladder(scene, "numpy", 2, 1e5)] == [*ladder(scene, "symplectic_euler", 2, 1e5)]
    assert lag_time(scene, "numpy", effort) == lag_time(scene, "symplectic_euler", effort) > 0
    theirs, ours = (path_of(FLAT, scene, name, effort, 10**6) for name in ("numpy", "symplectic_euler"))
    np.testing.assert_allclose(theirs.states["position"], ours.states["position"], rtol=0, atol=1e-12)
    assert theirs.computed == theirs.evaluations == ours.evaluations == 120


def test_past_its_budget_a_run_is_not_known():
    scene = scene_of(PROBLEMS["tumbling-throw"], BASE, 1e4)
    path = path_of(PROBLEMS["tumbling-throw"], scene, "symplectic_euler", Effort(120_000, math.nan), 1000)
    assert path.computed == 1000
    assert np.isfinite(path.states["position"][:3]).all()
    assert np.isnan(path.states["position"][-1]).all()
