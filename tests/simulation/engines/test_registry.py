"""Engines in the place of our own steps: the same runs, the same verdicts, whoever makes them."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from stiffdice.dynamics.state import STATE, start_of
from stiffdice.errors import InputError, NotInstalledError, StiffdiceError
from stiffdice.experiments.engines import flat
from stiffdice.integrators import registry as schemes
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.engines.registry import ENGINES, METHODS, adapter_of
from stiffdice.simulation.initial_conditions import phased
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import simulate

octave = pytest.mark.skipif(shutil.which("octave-cli") is None, reason="needs Octave")
TRANSCRIPTIONS = ["numpy", pytest.param("octave", marks=octave)]

SCENE = flat(Scene(), friction=0.0)

TILTED = {
    "launch": {"angular_momentum": [0.3, 0.5, 0.2], "orientation": [0.1, 0.2, 0.3]},
    "ground": {"normal": [0.1, 0, 1], "friction": 0.3},
    "duration": 3.0,
}


@pytest.mark.parametrize("engine", TRANSCRIPTIONS)
@pytest.mark.parametrize(
    ("model", "preset", "mapping"), [("tumbling", "as_listed", TILTED), ("sliding", "as_written", {})]
)
@pytest.mark.long
def test_a_transcription_of_the_paper_is_our_scheme(engine, model, preset, mapping):
    """To round-off before the first bounce, and after it to what a contact or some make of that."""
    scene = from_mapping(mapping, preset)
    theirs = simulate(scene, model=model, simulator=engine, steps=3000, every=1)
    ours = simulate(scene, model=model, steps=3000, every=1)
    (first,) = np.flatnonzero(ours.trajectory.elastic_energy > 0)[:1]
    assert 100 < first < 2500
    for name in STATE.names:
        away = np.abs(theirs.trajectory.state[name] - ours.trajectory.state[name]).reshape(3001, -1).max(axis=1)
        assert away[:first].max() < 1e-12, name
        assert away.max() < 1e-9, name
    assert theirs.evaluations == ours.evaluations
    assert theirs.verdict == ours.verdict
    assert theirs.scheme == "symplectic_euler"


@octave
@pytest.mark.parametrize("model", ["vertical", "flying"])
@pytest.mark.parametrize("preset", ["as_listed", "as_written"])
@pytest.mark.long
def test_two_transcriptions_are_one_model(model, preset):
    mapping = {"launch": {"position": [0, 0, 1], "angular_momentum": [0.3, 0.5, 0.2]}}
    scene = from_mapping(mapping, preset)
    found = []
    for engine in ("numpy", "octave"):
        found.append(np.zeros(300, STATE))
        adapter_of(engine)(scene, model, start_of(scene, model), 1e-3, 1e-9).advance(found[-1], 5)
    for name in STATE.names:
        np.testing.assert_allclose(found[0][name], found[1][name], rtol=0, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("engine", TRANSCRIPTIONS)
def test_kept_states_are_those_of_single_steps_however_they_are_asked_for(engine, monkeypatch):
    scene = from_mapping(TILTED, "as_listed")
    launch, adapter = start_of(scene, "tumbling"), adapter_of(engine)
    single, parted, kept = np.zeros(60, STATE), np.zeros(60, STATE), np.zeros(4, STATE)
    adapter(scene, "tumbling", launch, 1e-2, 1e-9).advance(single, 1)
    run = adapter(scene, "tumbling", launch, 1e-2, 1e-9)
    run.advance(parted[:7], 1)
    run.advance(parted[7:], 1)
    assert parted.tobytes() == single.tobytes()
    monkeypatch.setattr(adapter, "BATCH", 4, raising=False)
    assert adapter(scene, "tumbling", launch, 1e-2, 1e-9).advance(kept, 15) == 60
    assert kept.tobytes() == single[14::15].tobytes()


def test_an_ensemble_is_judged_as_ours_is(monkeypatch):
    """Members one after another, some stopped early, some never: measures, verdicts and the steps that decided.

    Ours takes flights at once: of the round-off in which that differs, bounces make 4e-8 in 430 steps. Stepped one by
    one, ours is NumPy's to the last bit.
    """
    scene = from_mapping({"ground": {"stiffness": 1e3}}, "as_written")
    members = phased(scene, "sliding", 430, 6)
    asked = {"energy": 0.05}
    ours = simulate(scene, model="sliding", steps=430, members=members, criteria=asked, stop=asked)
    assert len(set(ours.steps_done)) == 5
    assert {*ours.verdict} == {Verdict.PASSED, Verdict.ENERGY_GREW}
    for chunk in (engines._FIRST, 7):
        monkeypatch.setattr(engines, "_FIRST", chunk)
        theirs = simulate(
            scene, model="sliding", simulator="numpy", steps=430, members=members, criteria=asked, stop=asked
        )
        np.testing.assert_array_equal(theirs.steps_done, ours.steps_done)
        np.testing.assert_array_equal(theirs.decided, ours.decided)
        np.testing.assert_array_equal(theirs.verdict, ours.verdict)
        np.testing.assert_allclose(theirs.touchdown_phase, ours.touchdown_phase, rtol=1e-9)
        for name, measure in ours.measures.items():
            np.testing.assert_allclose(theirs.measures[name], measure, rtol=1e-6, atol=1e-12, err_msg=name)
        assert (theirs.steps_computed == theirs.steps_done).all()


def test_samples_and_progress_are_those_of_the_whole_run():
    scene = from_mapping({"duration": 2.0}, "as_written")
    told = []
    every = simulate(scene, model="sliding", simulator="numpy", steps=1000, every=30, progress=told.append)
    single = simulate(scene, model="sliding", simulator="numpy", steps=1000, every=1)
    assert every.trajectory.state.tobytes() == single.trajectory.state[::30].tobytes()
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_a_run_past_its_budget_is_undecided():
    run = simulate(from_mapping({}), model="sliding", simulator="numpy", steps=5000, budget=300)
    assert run.verdict == [Verdict.UNDECIDED]
    assert run.steps_done == [300]


@pytest.mark.parametrize("engine", [*TRANSCRIPTIONS, "scipy"])
@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_a_run_that_fails_is_a_result(engine, model):
    """What leaves the range of doubles, or makes LSODA give up, ends with a verdict."""
    scene = from_mapping({"cube": {"mass": 1e-9}, "ground": {"stiffness": 1e308}}, "as_written")
    run = simulate(scene, model=model, simulator=engine, steps=60)
    ours = simulate(scene, model=model, steps=60)
    assert ours.verdict == [Verdict.LEFT_NUMERIC_RANGE]
    assert run.verdict == ours.verdict
    assert run.steps_done <= 60
    assert engine == "scipy" or run.steps_done == ours.steps_done


@pytest.mark.parametrize("chunk", [engines._FIRST, 17])
def test_lsoda_tells_the_exact_state_after_each_of_our_steps(chunk, monkeypatch):
    """However often it is begun anew."""
    monkeypatch.setattr(engines, "_FIRST", chunk)
    monkeypatch.setattr(engines, "_MOST", chunk)
    scene = from_mapping({"duration": 3.0}, "as_written")
    theirs = simulate(scene, model="sliding", simulator="scipy", steps=400, tolerance=1e-11, every=1)
    exact = simulate(scene, model="sliding", scheme="exact", steps=400, every=1)
    for name in ("position", "velocity"):
        np.testing.assert_allclose(theirs.trajectory.state[name], exact.trajectory.state[name], rtol=0, atol=1e-8)
    assert theirs.scheme == "lsoda"
    assert theirs.simulator_version.startswith("scipy ")
    assert theirs.measures["restitution_error"] < 1e-9


def test_what_cannot_be_is_told_in_one_line(monkeypatch):
    scene = from_mapping({})
    with pytest.raises(InputError, match=r"simulator = ode: allowed is stiffdice or mujoco or"):
        simulate(scene, simulator="ode")
    with pytest.raises(InputError, match=r"simulator = numpy: scheme = rk4: allowed is symplectic_euler"):
        simulate(scene, simulator="numpy", scheme="rk4")
    with pytest.raises(InputError, match="simulator = numpy: it is too small"):
        monkeypatch.setattr(adapter_of("numpy"), "unfit", lambda scene, model: "it is too small")
        simulate(scene, simulator="numpy")


@pytest.mark.parametrize("engine", ENGINES)
def test_an_engine_that_is_not_installed_says_what_it_needs(engine, monkeypatch):
    def failing():
        raise ModuleNotFoundError("No module named 'it'", name="it")

    adapter_of.cache_clear()
    monkeypatch.setitem(METHODS, engine, METHODS[engine]._replace(load=failing))
    with pytest.raises(NotInstalledError) as caught:
        simulate(from_mapping({}), simulator=engine)
    assert str(caught.value).startswith(
        f"simulator = {engine}: needs {METHODS[engine].needs}, which is not installed; "
    )
    adapter_of.cache_clear()


def test_an_engine_that_is_broken_says_how(monkeypatch):
    def failing():
        raise ImportError("libGL.so.1: no such file")

    adapter_of.cache_clear()
    monkeypatch.setitem(METHODS, "drake", METHODS["drake"]._replace(load=failing))
    with pytest.raises(NotInstalledError, match=r"simulator = drake: Drake cannot be loaded: libGL"):
        engines.adapter_of("drake")
    adapter_of.cache_clear()


def test_a_scheme_makes_the_run_that_simulate_makes_however_it_is_cut():
    whole = simulate(SCENE, model="sliding", steps=2000, every=100).trajectory
    run = engines.adapter_of("symplectic_euler")(SCENE, "sliding", start_of(SCENE, "sliding"), SCENE.duration / 2000)
    states = np.zeros(20, STATE)
    assert run.advance(states[:7], 100) == 700
    assert run.advance(states[7:], 100) == 1300
    np.testing.assert_array_equal(states["position"], whole.state["position"][1:])


def test_an_engine_and_a_scheme_are_started_alike():
    ends = []
    for method in ("symplectic_euler", "numpy"):
        run = engines.ready(method, SCENE, "sliding", 500, 5)
        assert run()().evaluations == 500
        states = np.zeros(1, STATE)
        engines.adapter_of(method)(SCENE, "sliding", start_of(SCENE, "sliding"), 0.001).advance(states, 200)
        ends.append(states["position"])
    np.testing.assert_allclose(*ends, rtol=1e-12)


def test_methods_are_schemes_and_engines():
    assert engines.chosen_from(["rk4", "numpy"]) == ["rk4", "numpy"]
    with pytest.raises(InputError, match="methods = bullet"):
        engines.chosen_from(["bullet"])
    assert (
        engines.adapter_of("symplectic_euler").LAG
        == schemes.LAGS["symplectic_euler"]
        == engines.adapter_of("numpy").LAG
    )
    assert engines.METHODS["scipy"].own_steps
    assert engines.METHODS["event"].own_steps
    assert not engines.METHODS["numpy"].own_steps
    assert (
        engines.METHODS["numpy"].dearness
        > engines.METHODS["scipy_lsoda"].dearness
        > engines.METHODS["rk4"].dearness
        == 1
    )


def test_versions_are_told_of_engines_alone():
    assert engines.attributes(["rk4"]) == {}
    told = engines.attributes(["rk4", "numpy", "scipy"])["engine_versions"]
    assert told.startswith(f"numpy {np.__version__}; scipy ")


def test_what_a_method_cannot_represent_is_told():
    tilted = Scene().with_ground(normal=(0.6, 0.0, 0.8), contact="gated")
    assert "ground" in str(engines.adapter_of("exact").unfit(tilted, "sliding"))
    assert engines.adapter_of("numpy").unfit(tilted, "sliding") is None


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_bare_steps_are_those_of_the_simulator_to_the_last_bit(model):
    scene = from_mapping({"launch": {"angular_momentum": [0.3, 0.5, 0.2]}, "duration": 2.0}, "as_written")
    run = engines.ready("symplectic_euler", scene, model, 20_000, 10)
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
        engines.ready(method, Scene(), model, steps, 10)


@octave
def test_octaves_own_words_are_told_and_the_next_run_has_another():
    from stiffdice.simulation.engines import octave as module

    process = module._process()
    with pytest.raises(StiffdiceError, match=r"Octave gave up: .*out of memory"):
        process.answer(np.array([1e18, *np.zeros(52)]), 8)
    assert module._process() is not process
    assert simulate(from_mapping({}), model="sliding", simulator="octave", steps=5).steps_done == [5]


@octave
@pytest.mark.parametrize("end", ["", "os.kill(os.getpid(), 9)"])
def test_octave_ends_with_who_asked_it(end):
    code = (
        "import os, numpy as np\n"
        "from stiffdice.simulation.engines import octave\n"
        "print(octave._process()._octave.pid, flush=True)\n" + end
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == (-signal.SIGKILL if end else 0)
    pid = int(done.stdout)
    deadline = time.monotonic() + 20
    while _lives(pid):
        assert time.monotonic() < deadline
        time.sleep(0.05)


@octave
@pytest.mark.long
def test_an_octave_that_is_terminated_leaves_no_file_behind(tmp_path):
    from stiffdice.simulation.engines.octave import PROGRAM, SCRIPT

    command = [PROGRAM, "--quiet", "--norc", "--no-history", str(SCRIPT)]
    with subprocess.Popen(command, cwd=tmp_path, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL) as waiting:
        time.sleep(1)
        waiting.terminate()
    assert not [*tmp_path.iterdir()]


def _lives(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    # A process whose parent did not wait for it has ended, too.
    return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
