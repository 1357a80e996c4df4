"""What `advise` promises is kept, and what it cannot promise it says."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.advice.problems import flat, held, resting, scene

from stiffdice.advice import pilot as pilot_module
from stiffdice.advice.pilot import SAMPLES
from stiffdice.advice.recommend import advise, parsed_error
from stiffdice.advice.result import MEASURED, check, run_advised
from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError

SCENES = {
    "tumbling": scene,
    "sliding with friction": lambda **ground: scene(launch={"node_velocity": "rigid"}, **ground),
    "flat": flat,
    "resting": resting,
}


CASES = [(kind, stiffness) for kind in SCENES for stiffness in ((1e2, 1e4) if kind == "resting" else (1e2, 1e7, 1e12))]


@pytest.mark.parametrize(("kind", "stiffness"), CASES)
@pytest.mark.parametrize(
    "error", [pytest.param(1e-1, marks=pytest.mark.broad), 1e-3, pytest.param(1e-6, marks=pytest.mark.broad)]
)
@pytest.mark.long
def test_a_promise_is_kept(kind, stiffness, error):
    """By a run of twice the cost; where contacts are short, it is cheap at every stiffness."""
    scheme = "exact" if kind == "flat" else "event"
    advice = advise(SCENES[kind](stiffness=stiffness), error, scheme=scheme)
    assert advice.horizon == 3.0
    assert advice.best.basis == MEASURED
    assert advice.best.error <= error
    assert advice.best.evaluations < (200_000 if kind == "resting" else 2_000)
    found = check(advice, run_advised(advice, advice.best))
    assert found.kept
    assert found.found <= error


@pytest.mark.long
def test_chaos_is_told_and_the_promise_ends_before_it():
    problem = scene(duration=20.0)
    advice = advise(problem, 0.01, scheme="event")
    assert 5 < advice.horizon < 15
    assert advice.duration == 20
    assert "round-off grows" in advice.cut
    assert advice.growth_per_landing > 2
    assert check(advice, run_advised(advice, advice.best)).kept
    sooner = advise(problem, 0.01, horizon=3.0, scheme="event")
    assert (sooner.horizon, sooner.cut) == (3.0, "")
    assert sooner.best.tolerance > advice.best.tolerance


def test_an_error_below_round_off_is_refused_with_the_floor():
    advice = advise(flat(), 1e-17, scheme="event")
    assert advice.best is None
    assert "double precision itself knows the path to" in advice.cut


@pytest.mark.long
def test_all_schemes_that_fit_are_compared():
    advice = advise(scene(stiffness=1e6), 1e-3)
    names = {option.scheme for option in advice.options}
    assert names == {"symplectic_euler", "forward_euler", "velocity_verlet", "rk4", "implicit_euler", "event"}
    by = {option.scheme: option for option in advice.options}
    assert advice.best is by["event"]
    assert by["symplectic_euler"].evaluations > 1000 * by["event"].evaluations
    assert by["event"].margin is None
    omega_h = linear_theory.contact_frequency(1e6, 1.0, 6) * 3 / by["symplectic_euler"].steps
    assert by["symplectic_euler"].omega_h == pytest.approx(omega_h)
    assert by["symplectic_euler"].margin == pytest.approx(2 / omega_h, rel=1e-3)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"stiffness": 1e13}, "ground.stiffness = 1e+13: tried from 100 to 1e+12"),
        ({"stiffness": 10}, "ground.stiffness = 10: tried from 100"),
        ({"damping": 150}, "a damping ratio of 1.5; tried up to"),
        ({"normal": [0.1, 0, 1]}, "ground.normal"),
    ],
)
def test_outside_the_studied_range_is_said(change, told):
    assert advise(scene(duration=1.5), 0.01, scheme="event").outside == ()
    advice = advise(scene(duration=1.5, **change), 0.01, scheme="event")
    assert any(told in text for text in advice.outside)


@pytest.mark.long
def test_where_nothing_touches_the_parabola_is_all():
    advice = advise(scene(duration=0.5), 1e-9, scheme="velocity_verlet")
    (verlet,) = advice.options
    assert (advice.model, advice.landings) == ("flying", 0)
    assert (verlet.keeps, verlet.steps, verlet.margin) == (True, SAMPLES, None)


@pytest.mark.broad
def test_where_nothing_touches_event_costs_nothing():
    """A kernel of its own, for this alone."""
    advice = advise(scene(duration=0.5), 1e-9, scheme="event")
    assert (advice.model, advice.best.evaluations, advice.landings) == ("flying", 0, 0)


@pytest.mark.parametrize(("text", "value"), [("1%", 0.01), (" 0.5 % ", 0.005), ("1e-6", 1e-6), ("1", 1.0)])
def test_an_error_is_a_part_or_a_percentage(text, value):
    assert parsed_error(text) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("text", ["0", "-1%", "101%", "nan", "inf", "%", "1%%", "small", ""])
def test_an_error_that_is_none_is_told(text):
    with pytest.raises(InputError, match=r"--error = .*: allowed is a part of the radius"):
        parsed_error(text)


@pytest.mark.long
def test_a_pilot_that_takes_too_long_ends_and_advice_with_it():
    """A cube that chatters on stiff ground costs event a step for every swing."""
    advice = advise(resting(stiffness=1e8), 1e-3, scheme="event", patience=100_000)
    assert 0 < advice.horizon < 3
    assert "takes more than 100,000 force evaluations" in advice.cut
    again = advise(resting(stiffness=1e8), 1e-3, scheme="event", patience=100_000)
    assert (again.horizon, again.best.tolerance, again.floor) == (advice.horizon, advice.best.tolerance, advice.floor)
    assert check(advice, run_advised(advice, advice.best)).kept


@pytest.mark.long
def test_what_takes_too_long_is_no_option_where_another_scheme_knows_the_path():
    launch = {"position": [0, 0, 0.5177], "velocity": [0.3, 0, 0], "node_velocity": "rigid"}
    quiet = scene(stiffness=1e12, damping=2e3, friction=0, launch=launch)
    advice = advise(quiet, 1e-6, scheme="event", patience=100_000)
    (option,) = advice.options
    assert (advice.best, option.keeps, option.error) == (None, False, None)
    assert "takes more than" in option.evidence
    assert advise(quiet, 1e-6, scheme="exact").best.error < 1e-9


@pytest.mark.long
def test_methods_that_part_end_the_promise(monkeypatch):
    """Were LSODA another path, nothing would be promised from where it leaves ours."""
    honest = pilot_module._by_another_method

    def astray(problem, *given):
        trial, name = honest(problem, *given)
        late = np.arange(SAMPLES + 1) / SAMPLES * problem.duration > 2
        return dataclasses.replace(trial, places=trial.places + 1e-4 * late[:, None]), name

    monkeypatch.setattr(pilot_module, "_by_another_method", astray)
    advice = advise(held(), 1e-6, scheme="event")
    assert "event and SciPy's LSODA agree on the path until t = 3 s to 0.0002 radii only" in advice.cut
    assert 1.9 <= advice.horizon <= 2


def test_a_second_method_that_takes_too_long_is_said():
    advice = advise(scene(), 1e-3, scheme="event", patience=5_000)
    assert "by no second method: SciPy's LSODA takes more than 1,000 force evaluations" in advice.best.evidence
    assert len(advice.paths) == 1
