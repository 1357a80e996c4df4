from __future__ import annotations

import numpy as np
import pytest

from stiffdice import runners, schemes
from stiffdice.errors import InputError
from stiffdice.one_bounce import level
from stiffdice.scene import Scene
from stiffdice.simulate import simulate
from stiffdice.state import STATE, start_of

SCENE = level(Scene(), friction=0.0)


def test_a_scheme_makes_the_run_that_simulate_makes_however_it_is_cut():
    whole = simulate(SCENE, model="sliding", steps=2000, every=100).trajectory
    run = runners.start("symplectic_euler", SCENE, "sliding", start_of(SCENE, "sliding"), SCENE.duration / 2000)
    states = np.zeros(20, STATE)
    assert run.advance(states[:7], 100) == 700
    assert run.advance(states[7:], 100) == 1300
    np.testing.assert_array_equal(states["position"], whole.state["position"][1:])


def test_an_engine_and_a_scheme_are_started_alike():
    ends = []
    for method in ("symplectic_euler", "numpy"):
        go = runners.ready(method, SCENE, "sliding", start_of(SCENE, "sliding"), 500, 5)
        assert go()() == 500
        states = np.zeros(1, STATE)
        runners.start(method, SCENE, "sliding", start_of(SCENE, "sliding"), 0.001).advance(states, 200)
        ends.append(states["position"])
    np.testing.assert_allclose(*ends, rtol=1e-12)


def test_methods_are_schemes_and_engines():
    assert runners.chosen_from(["rk4", "numpy"]) == ["rk4", "numpy"]
    with pytest.raises(InputError, match="methods = bullet"):
        runners.chosen_from(["bullet"])
    assert runners.lag("symplectic_euler") == schemes.LAGS["symplectic_euler"] == runners.lag("numpy")
    assert runners.own_steps("scipy")
    assert runners.own_steps("event")
    assert not runners.own_steps("numpy")
    assert runners.dearness("numpy") > runners.dearness("scipy_lsoda") > runners.dearness("rk4") == 1


def test_versions_are_told_of_engines_alone():
    assert runners.attributes(["rk4"]) == {}
    told = runners.attributes(["rk4", "numpy", "scipy"])["engine_versions"]
    assert told.startswith(f"numpy {np.__version__}; scipy ")


def test_what_a_method_cannot_represent_is_told():
    tilted = Scene().with_ground(normal=(0.6, 0.0, 0.8), contact="gated")
    assert "ground" in str(runners.unfit("exact", tilted, "sliding"))
    assert runners.unfit("numpy", tilted, "sliding") is None
