"""Every run ends by a budget with a verdict, and Ctrl-C ends any, also within one interval of a scheme's own steps."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from stiffdice.advice.pilot import PATIENCE
from stiffdice.advice.recommend import advise
from stiffdice.cli.main import main
from stiffdice.errors import InputError
from stiffdice.integrators import registry as schemes
from stiffdice.io.reader import open_file
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import simulate

# Scenes that need more steps of `event` than anybody has time for, or next to none of them.
EXTREMES = {
    "damping": {"ground": {"damping": 1e15}},
    "spin": {"launch": {"angular_momentum": [1e12, 0, 0]}},
    "radius": {"cube": {"radius": 1e-7, "geometry": "exact"}},
    "stiffness": {"ground": {"stiffness": 1e300, "friction": 1e15}, "duration": 1e10},
}
RESTING = {"position": [0, 0, 0.5177], "velocity": [0.3, 0, 0], "node_velocity": "rigid"}


def extreme(kind, law):
    keys = EXTREMES[kind]
    return from_mapping(keys | {"ground": keys.get("ground", {}) | {"contact": law}})


@pytest.mark.parametrize("kind", EXTREMES)
@pytest.mark.parametrize("law", ["gated", pytest.param("ungated", marks=pytest.mark.broad)])
@pytest.mark.parametrize(("steps", "share"), [(1, 0.05), (10_000, 0.05), pytest.param(1, 1.0, marks=pytest.mark.broad)])
@pytest.mark.long
def test_event_ends_with_a_verdict_whatever_the_scene(kind, law, steps, share):
    """A few seconds of work, however the intervals are; of such a share of the budget."""
    simulate(extreme(kind, law), scheme="event", steps=1, budget=1)  # compiles
    given, begun = {} if share == 1 else {"budget": round(share * schemes.BUDGET)}, time.process_time()
    run = simulate(extreme(kind, law), scheme="event", steps=steps, every=steps, **given)
    assert time.process_time() - begun < 60 * share
    assert run.evaluations[0] <= share * schemes.BUDGET + schemes.PART + 200
    ended = Verdict(run.verdict[0])
    assert (run.steps_done[0] == steps) == (ended in (Verdict.PASSED, Verdict.SANK))
    assert ended in (Verdict.PASSED, Verdict.SANK, Verdict.UNDECIDED, Verdict.LEFT_NUMERIC_RANGE)


@pytest.mark.long
def test_no_part_of_a_run_takes_longer_than_ctrl_c_may_wait():
    told = [time.process_time()]
    scene = extreme("spin", "gated")
    simulate(scene, scheme="event", steps=1, budget=1)
    budget = schemes.BUDGET // 2
    simulate(scene, scheme="event", steps=1, budget=budget, progress=lambda _: told.append(time.process_time()))
    assert len(told) > 20
    assert np.median(np.diff(told)) < 0.2


@pytest.mark.parametrize(("scheme", "model"), [("event", "tumbling"), ("exact", "sliding")])
def test_a_step_taken_in_parts_is_the_step(scheme, model, monkeypatch):
    """A run in one interval goes on where its parts end: what many intervals give, to round-off."""
    launch = RESTING if scheme == "event" else {"position": [0, 0, 0.6], "velocity": [0.3, 0, 0]}
    ground = {"contact": "gated", "stiffness": 1e7 if scheme == "event" else 1e4, "damping": 1e-6, "friction": 0}
    scene = from_mapping({"ground": ground, "launch": launch, "duration": 3.0 if scheme == "event" else 2e4})
    whole = simulate(scene, model=model, scheme=scheme, steps=1)
    assert whole.evaluations[0] > 1.5 * schemes.PART
    assert Verdict(whole.verdict[0]) == Verdict.PASSED
    many = simulate(scene, model=model, scheme=scheme, steps=50)
    np.testing.assert_allclose(whole.end["position"], many.end["position"], rtol=1e-8)


def test_a_budget_spent_within_an_interval_is_undecided_and_again_the_same():
    scene = from_mapping({"ground": {"contact": "gated", "stiffness": 1e10}, "launch": RESTING, "duration": 3.0})
    run, again = (simulate(scene, scheme="event", steps=3, every=1, budget=100_000) for _ in range(2))
    assert Verdict(run.verdict[0]) == Verdict.UNDECIDED
    assert run.steps_done[0] < 3
    assert len(run.trajectory.time) == run.steps_done[0] + 1
    assert 90_000 < run.evaluations[0] < 100_000 + schemes.PART + 200  # to find touch-downs is work, too
    np.testing.assert_array_equal(run.end, again.end)


def test_an_engine_of_its_own_steps_has_a_budget_too():
    scene = extreme("radius", "gated")
    run = simulate(scene, simulator="scipy", tolerance=1e-12, steps=600, every=1, budget=50_000)
    assert Verdict(run.verdict[0]) == Verdict.UNDECIDED
    assert run.evaluations[0] == 50_000
    assert np.isfinite(run.trajectory.state["position"]).all()


@pytest.mark.long
def test_run_has_a_budget_and_stores_what_it_bought(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.yaml").write_text("ground: {damping: 1.0e15, contact: gated}\n")
    words = ["run", "a.yaml", "--scheme", "event", "--budget", "1e5", "--steps", "1000", "-o", "a.h5"]
    assert main(words) == 0
    assert "a.h5: undecided" in capsys.readouterr().out
    assert 0 < open_file("a.h5").sizes["time"] < 1001
    (tmp_path / "b.yaml").write_text("ground: {contact: gated}\n")
    words = ["run", "b.yaml", "--steps", "1e4", "--budget", "6e3", "--ledger", "-o", "b.h5"]
    assert main(words) == 0
    assert "b.h5: undecided" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    assert "default: 1e7" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("kind", EXTREMES)
@pytest.mark.parametrize("law", ["gated", pytest.param("ungated", marks=pytest.mark.broad)])
@pytest.mark.long
def test_advise_ends_soon_whatever_the_scene(kind, law):
    """With advice, for a part of the time at least, or by saying that it finds no path: by its patience, in seconds."""
    share = 0.1
    for _ in range(2):  # the first compiles
        begun = time.process_time()
        try:
            advice = advise(extreme(kind, law), 0.01, scheme="event", patience=round(share * PATIENCE))
        except InputError as refused:
            assert "no path" in str(refused)
        else:
            assert 0 < advice.horizon <= advice.duration
    assert time.process_time() - begun < 60 * share


LONG = {
    "event within an interval": "run a.yaml --scheme event --steps 1 --budget 1e12 -o a.h5",
    "many fixed steps": "run a.yaml --steps 1e12 --every 1e9 -o a.h5",
    "the ledger": "run b.yaml --steps 3e7 --ledger -o a.h5",
    "scipy": "run b.yaml --simulator scipy --tolerance 1e-9 --set duration=1e4 --steps 1e5 --budget 1e12 -o a.h5",
    "advise": "advise a.yaml --error 1e-9",
}


@pytest.mark.parametrize(
    "kind",
    [
        kind if kind in ("event within an interval", "advise") else pytest.param(kind, marks=pytest.mark.broad)
        for kind in LONG
    ],
)
@pytest.mark.long
def test_ctrl_c_ends_a_run_at_once(kind, tmp_path):
    ground = "stiffness: 1.0e+10, contact: gated"
    launch = "position: [0, 0, 0.5177], velocity: [0.3, 0, 0], node_velocity: rigid"
    (tmp_path / "a.yaml").write_text(f"ground: {{{ground}}}\nlaunch: {{{launch}}}\nduration: 1.0e+6\n")
    (tmp_path / "b.yaml").write_text("ground: {contact: gated}\n")
    words = [sys.executable, "-m", "stiffdice.cli", *LONG[kind].split()]
    with subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as started:
        with pytest.raises(subprocess.TimeoutExpired):  # started, and at work
            started.wait(3)
        started.send_signal(signal.SIGINT)
        _, told = started.communicate(timeout=30)  # the run itself takes longer
    assert started.returncode == 130
    assert "interrupted; nothing was stored" in told
    assert not (tmp_path / "a.h5").exists()
