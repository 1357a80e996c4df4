from __future__ import annotations

import importlib
import re
import subprocess
import sys

import numpy as np
import pytest

from stiffdice.dynamics.code_digest import PACKAGE
from stiffdice.dynamics.state import start_of
from stiffdice.errors import InputError
from stiffdice.experiments.work_precision.problems import PROBLEMS, SAMPLES, Judge, scene_of
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.engines import scipy_ivp
from stiffdice.simulation.engines.registry import SOLVERS, Peer
from stiffdice.simulation.run import simulate

THROW = {
    "ground": {"stiffness": 100, "damping": 0.5, "friction": 0.1},
    "launch": {"angular_momentum": [0.3, 0.5, 0.2]},
    "duration": 3.0,
}


def solved(peer, scene, model, tolerance):
    return engines.ready(peer, scene, model, SAMPLES, SAMPLES, tolerance)()()


@pytest.mark.parametrize("peer", SOLVERS)
@pytest.mark.parametrize("stiffness", [1e2, 1e12])
def test_a_flat_bounce_is_the_exact_one(peer, stiffness):
    """Against the contact law's own solution, to a hundred times the tolerance: no contact is missed, however short."""
    flat = PROBLEMS["flat-bounce"]
    scene = scene_of(flat, from_mapping({"ground": {"damping": 0.1}, "duration": 3.0}), stiffness)
    path = solved(peer, scene, flat.model, 1e-10)
    assert Judge(flat, scene, path.states).errors(path.states)["restitution"] < 1e-8


@pytest.mark.parametrize("peer", SOLVERS)
@pytest.mark.parametrize(("model", "preset"), [("tumbling", "as_written"), ("sliding", "as_listed")])
def test_the_motion_is_that_of_our_steps_as_these_become_short(peer, model, preset):
    """Of first order; where nodes meet the ground within a step, no smoother than that."""
    scene = from_mapping(THROW, preset)
    path = solved(peer, scene, model, 1e-9)
    runs = [
        simulate(scene, model=model, steps=steps, every=steps // SAMPLES).trajectory.state
        for steps in (12_000, 240_000)
    ]
    for name in ("position", "velocity", "angular_momentum", "node_offset"):
        coarse, fine = (np.abs(run[name] - path.states[name]).max() for run in runs)
        assert fine < 1e-3
        assert fine < coarse / 10 or coarse == 0


def test_the_launch_comes_first_and_nodes_keep_their_distances():
    scene = from_mapping(THROW, "as_written")
    states = solved("scipy_lsoda", scene, "tumbling", 1e-6).states
    (launch,) = start_of(scene, "tumbling")
    for name in states.dtype.names:
        np.testing.assert_allclose(states[0][name], launch[name], rtol=0, atol=1e-15)
    lengths = np.linalg.norm(states["node_offset"], axis=2)
    np.testing.assert_allclose(lengths, lengths[0, 0], rtol=1e-14)


def test_the_jacobian_says_how_the_slope_changes():
    """In a contact, along random directions; the force's parts are linear in depth and nearly so in the rest."""
    scene = from_mapping(THROW, "as_written")
    slope, slopes = scipy_ivp.equations("tumbling")
    room = scipy_ivp.room_of(scene, start_of(scene, "tumbling"))
    y = np.concatenate([[0.0, 0.0, 0.4], [3.0, 1.0, -2.0], [0.3, 0.5, 0.2], [0.9, 0.3, 0.2, 0.1]])
    jacobian = slopes(0.0, y, room, np.ones(len(y)))
    random = np.random.default_rng(1)
    for _ in range(5):
        way = random.standard_normal(len(y)) * 1e-6
        change = (slope(0.0, y + way, room) - slope(0.0, y - way, room)) / 2
        np.testing.assert_allclose(jacobian @ way, change, rtol=1e-4, atol=1e-4 * np.abs(change).max())


@pytest.mark.parametrize("peer", SOLVERS)
def test_a_finer_tolerance_costs_more_and_is_nearer(peer):
    scene = from_mapping(THROW, "as_written")
    fine, coarse, reference = (solved(peer, scene, "tumbling", tolerance) for tolerance in (1e-8, 1e-3, 1e-11))
    assert fine.evaluations > coarse.evaluations > SAMPLES
    assert fine.computed == fine.evaluations
    away = [np.abs(path.states["position"] - reference.states["position"]).max() for path in (fine, coarse)]
    assert away[0] < away[1] / 100


def test_what_fails_is_not_a_number_and_says_no_more():
    states = solved("scipy_lsoda", from_mapping(THROW, "as_written"), "tumbling", 1e-17).states
    assert np.isfinite(states["position"][0]).all()
    assert np.isnan(states["position"][1:]).all()


def test_a_peer_that_is_not_there_is_told(monkeypatch):
    with pytest.raises(InputError, match=r"method = euler: allowed is symplectic_euler or"):
        engines.ready("euler", Scene(), "sliding", 4, 4)
    engine = Peer(lambda: importlib.import_module("stiffdice_engine"), "Engine", "the package engine", "make it")
    monkeypatch.setitem(engines.METHODS, "engine", engine)
    with pytest.raises(InputError, match="method = engine: needs the package engine, which is not installed; make it"):
        engines.ready("engine", Scene(), "sliding", 4, 4)


@pytest.mark.long
def test_scipy_is_imported_by_its_peers_only_and_these_by_whom_they_are_asked_for():
    """Numba may look for SciPy on its own."""
    asking = re.compile(r"^\s*(import|from) scipy", re.MULTILINE)
    named = {path.name for path in PACKAGE.rglob("*.py") if asking.search(path.read_text())}
    # The last: a reference of meetings of two cubes; the two before it: rotations of measured tosses.
    assert named == {"scipy_ivp.py", "launches.py", "replay.py", "reference.py"}
    code = (
        "import sys, stiffdice.experiments.work_precision.measure, stiffdice.report.tables.methods; "
        "sys.exit('stiffdice.simulation.engines.scipy_ivp' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
