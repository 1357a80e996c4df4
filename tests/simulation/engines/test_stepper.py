from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.state import STATE, start_of
from stiffdice.errors import InputError
from stiffdice.experiments.engines import flat
from stiffdice.integrators import registry as schemes
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation.engines import stepper
from stiffdice.simulation.run import simulate

SCENE = flat(Scene(), friction=0.0)


def test_a_scheme_makes_the_run_that_simulate_makes_however_it_is_cut():
    whole = simulate(SCENE, model="sliding", steps=2000, every=100).trajectory
    run = stepper.start("symplectic_euler", SCENE, "sliding", start_of(SCENE, "sliding"), SCENE.duration / 2000)
    states = np.zeros(20, STATE)
    assert run.advance(states[:7], 100) == 700
    assert run.advance(states[7:], 100) == 1300
    np.testing.assert_array_equal(states["position"], whole.state["position"][1:])


def test_an_engine_and_a_scheme_are_started_alike():
    ends = []
    for method in ("symplectic_euler", "numpy"):
        run = stepper.ready(method, SCENE, "sliding", 500, 5)
        assert run()().evaluations == 500
        states = np.zeros(1, STATE)
        stepper.start(method, SCENE, "sliding", start_of(SCENE, "sliding"), 0.001).advance(states, 200)
        ends.append(states["position"])
    np.testing.assert_allclose(*ends, rtol=1e-12)


def test_methods_are_schemes_and_engines():
    assert stepper.chosen_from(["rk4", "numpy"]) == ["rk4", "numpy"]
    with pytest.raises(InputError, match="methods = bullet"):
        stepper.chosen_from(["bullet"])
    assert stepper.lag("symplectic_euler") == schemes.LAGS["symplectic_euler"] == stepper.lag("numpy")
    assert stepper.own_steps("scipy")
    assert stepper.own_steps("event")
    assert not stepper.own_steps("numpy")
    assert stepper.dearness("numpy") > stepper.dearness("scipy_lsoda") > stepper.dearness("rk4") == 1


def test_versions_are_told_of_engines_alone():
    assert stepper.attributes(["rk4"]) == {}
    told = stepper.attributes(["rk4", "numpy", "scipy"])["engine_versions"]
    assert told.startswith(f"numpy {np.__version__}; scipy ")


def test_what_a_method_cannot_represent_is_told():
    tilted = Scene().with_ground(normal=(0.6, 0.0, 0.8), contact="gated")
    assert "ground" in str(stepper.unfit("exact", tilted, "sliding"))
    assert stepper.unfit("numpy", tilted, "sliding") is None


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_bare_steps_are_those_of_the_simulator_to_the_last_bit(model):
    scene = from_mapping({"launch": {"angular_momentum": [0.3, 0.5, 0.2]}, "duration": 2.0}, "as_written")
    run = stepper.ready("symplectic_euler", scene, model, 20_000, 10)
    kept = simulate(scene, model=model, steps=20_000, every=2000)
    path = run()()
    assert path.states.tobytes() == kept.trajectory.state.tobytes()
    assert path.evaluations == path.computed == int(kept.evaluations[0]) == 20_000
    np.testing.assert_array_equal(run()().states, path.states)  # the launch is as it was


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (("symplectic_euler", "sliding", 25), "steps = 25: allowed is a multiple of samples = 10"),
        (("leapfrog", "sliding", 20), "method = leapfrog"),
        (("symplectic_euler", "rolling", 20), "model = rolling"),
    ],
)
def test_what_cannot_be_stepped_is_said(names, told):
    method, model, steps = names
    with pytest.raises(InputError, match=told):
        stepper.ready(method, Scene(), model, steps, 10)
