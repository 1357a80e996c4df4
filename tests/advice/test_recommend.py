"""What `advise` promises is kept, and what it cannot promise it says."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from stiffdice.advice import pilot as pilot_module
from stiffdice.advice.check import check, run_advised
from stiffdice.advice.pilot import SAMPLES, curve, flown, tried
from stiffdice.advice.recommend import advise, parsed_error
from stiffdice.advice.report import as_json, as_text, check_as_text, command
from stiffdice.advice.result import EXTRAPOLATED, MEASURED
from stiffdice.cli.main import main
from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError
from stiffdice.integrators import linear_stability
from stiffdice.integrators import registry as schemes
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation.run import simulate

SPIN = {"angular_momentum": [0.3, 0.5, 0.2], "node_velocity": "rigid"}


def scene(duration=3.0, stiffness=1e4, launch=None, **ground):
    """Gated, tumbling unless told otherwise: one law and model, compiled once."""
    ground = {"contact": "gated", "stiffness": stiffness, **ground}
    return from_mapping({"ground": ground, "launch": SPIN if launch is None else launch, "duration": duration})


def flat(**ground):
    return scene(launch={"node_velocity": "rigid"}, friction=0, **ground)


def resting(**ground):
    return scene(launch={"position": [0, 0, 0.5177], "velocity": [0.3, 0, 0], "node_velocity": "rigid"}, **ground)


SCENES = {
    "tumbling": scene,
    "sliding with friction": lambda **ground: scene(launch={"node_velocity": "rigid"}, **ground),
    "flat": flat,
    "resting": resting,
}


CASES = [(kind, stiffness) for kind in SCENES for stiffness in ((1e2, 1e4) if kind == "resting" else (1e2, 1e7, 1e12))]


@pytest.mark.parametrize(("kind", "stiffness"), CASES)
@pytest.mark.parametrize("error", [1e-1, 1e-3, 1e-6])
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


def test_the_error_is_the_root_mean_square_distance_in_radii():
    here = np.zeros((4, 3))
    there = np.array([[0, 0, 0], [3, 4, 0], [0, 0, 0], [0, 0, 5]])
    np.testing.assert_allclose(curve(here, there, 2.0), [0, 2.5 / 2**0.5, 2.5 / 3**0.5, 2.5 / 2**0.5])


def test_a_false_promise_is_found_broken():
    advice = advise(scene(), 1e-6, scheme="event")
    coarse = dataclasses.replace(advice.best, tolerance=0.1)
    found = check(advice, run_advised(advice, coarse))
    assert not found.kept
    assert "NOT KEPT" in check_as_text(found)
    fixed = dataclasses.replace(advice.best, scheme="symplectic_euler", tolerance=None, steps=50 * SAMPLES)
    assert not check(advice, run_advised(advice, fixed)).kept


@pytest.mark.long
def test_chaos_is_told_and_the_promise_ends_before_it():
    problem = scene(duration=20.0)
    advice = advise(problem, 0.01, scheme="event")
    assert 5 < advice.horizon < 15
    assert advice.duration == 20
    assert "round-off grows" in advice.cut
    assert advice.growth_per_landing > 2
    assert check(advice, run_advised(advice, advice.best)).kept
    text = as_text(advice, ["a.yaml"])
    assert as_text(advice, ["\x1b[2J"]).replace("\n", "").isprintable()
    assert f"t = {advice.horizon:g} s of 20 s" in text
    assert f"--set duration={advice.horizon:g}" in text
    sooner = advise(problem, 0.01, horizon=3.0, scheme="event")
    assert (sooner.horizon, sooner.cut) == (3.0, "")
    assert sooner.best.tolerance > advice.best.tolerance


def test_an_error_below_round_off_is_refused_with_the_floor():
    advice = advise(flat(), 1e-17, scheme="event")
    assert advice.best is None
    assert "double precision itself knows the path to" in advice.cut
    assert "none found" in as_text(advice, [])
    assert json.loads(as_json(advice))["advised"] is None


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


@pytest.mark.parametrize("zeta", [0.0, 0.1, 0.7, 3.0])
def test_limits_are_those_of_theory(zeta):
    """Those of two schemes by a formula, of two by their polynomials: −1 is a root there (Verlet), or |R| = 1."""
    assert linear_stability.stability_limit("symplectic_euler", zeta) == linear_theory.stability_limit(zeta)
    forward = 2 * zeta if zeta <= 1 else 2 / (zeta + (zeta**2 - 1) ** 0.5)
    assert linear_stability.stability_limit("forward_euler", zeta) == pytest.approx(forward)
    q = linear_stability.stability_limit("rk4", zeta)
    root = q * (-zeta + 1j * np.emath.sqrt(1 - zeta**2))
    other = q * (-zeta - 1j * np.emath.sqrt(1 - zeta**2))
    sizes = [abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24) for z in (root, other)]
    assert max(sizes) == pytest.approx(1, abs=1e-9)
    assert linear_stability.stability_limit("implicit_euler", zeta) == np.inf
    if zeta == 0:
        assert linear_stability.stability_limit("velocity_verlet", 0) == pytest.approx(2)
        assert q == pytest.approx(8**0.5)


def test_the_fastest_contact_rocks_unless_the_corners_carry_the_mass():
    solid = Scene()
    assert linear_stability.hardest(solid, "tumbling").omega == pytest.approx(
        linear_theory.contact_frequency(1e4, 1.0, 6)
    )
    corners = dataclasses.replace(solid, cube=dataclasses.replace(solid.cube, inertia="corners"))
    for case, model in ((solid, "sliding"), (corners, "tumbling")):
        assert linear_stability.hardest(case, model).omega == pytest.approx(
            linear_theory.contact_frequency(1e4, 1.0, 4)
        )
    assert linear_stability.hardest(solid, "flying").omega == 0
    assert linear_stability.hardest(solid, "sliding").zeta == pytest.approx(0.2 / 100)


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
    assert f"outside   {advice.outside[0]}" in as_text(advice, [])
    assert json.loads(as_json(advice))["outside"] == list(advice.outside)


@pytest.mark.long
def test_where_nothing_touches_the_parabola_is_all():
    advice = advise(scene(duration=0.5), 1e-9, scheme="event")
    assert advice.model == "flying"
    assert (advice.best.evaluations, advice.landings) == (0, 0)
    assert "no force to evaluate" in as_text(advice, [])
    (verlet,) = advise(scene(duration=0.5), 1e-9, scheme="velocity_verlet").options
    assert (verlet.keeps, verlet.steps, verlet.margin) == (True, SAMPLES, None)


@pytest.mark.parametrize(("text", "value"), [("1%", 0.01), (" 0.5 % ", 0.005), ("1e-6", 1e-6), ("1", 1.0)])
def test_an_error_is_a_part_or_a_percentage(text, value):
    assert parsed_error(text) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("text", ["0", "-1%", "101%", "nan", "inf", "%", "1%%", "small", ""])
def test_an_error_that_is_none_is_told(text):
    with pytest.raises(InputError, match=r"--error = .*: allowed is a part of the radius"):
        parsed_error(text)


def called(capsys, *arguments):
    try:
        status = main(["advise", *map(str, arguments)])
    except SystemExit as end:
        status = end.code
    return status, *capsys.readouterr()


NUMBERS = ["--contact", "gated", "--spin", "0.3,0.5,0.2", "--duration", "3", "--scheme", "event"]


def test_numbers_in_place_of_a_file_and_the_answer_for_people(capsys):
    status, out, err = called(capsys, "--stiffness", "1e6", "--mass", "0.5", *NUMBERS, "--error", "0.1%")
    assert status == 0
    assert err == ""
    for words in ("model     tumbling: the cube spins", "scheme    event, tolerance 1e-0", "0.001 asked", "root mean"):
        assert words in out
    for words in ("run time  about", "margin    none needed", "evidence  measured: "):
        assert words in out


def test_run_does_it_checks_it_and_stores_it(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.yaml").write_text("ground: {contact: gated}\nlaunch: {angular_momentum: [0.3, 0.5, 0.2]}\n")
    status, out, _ = called(capsys, "a.yaml", *NUMBERS[4:], "--run", "-o", "out.h5", "--json")
    content = json.loads(out)
    assert (status, content["check"]["kept"]) == (0, True)
    assert content["check"]["found_radii"] <= content["check"]["promised_radii"] == content["asked_radii"] == 0.01
    assert (tmp_path / "out.h5").exists()
    # The command that is shown makes the same run.
    _, told, _ = called(capsys, "a.yaml", *NUMBERS[4:])
    (line,) = (line.split() for line in told.splitlines() if line.startswith("  stiffdice run "))
    assert main([*line[1:-1], "again.h5"]) == 0
    assert (tmp_path / "out.h5").read_bytes() == (tmp_path / "again.h5").read_bytes()


def test_json_has_units_in_its_keys_and_every_option(capsys):
    status, out, _ = called(capsys, *NUMBERS, "--json")
    content = json.loads(out)
    assert status == 0
    assert set(content) == {
        *("scene", "asked_radii", "duration_s", "horizon_s", "cut", "model", "model_reason", "advised", "options"),
        *("floor_radii", "landings", "growth", "growth_per_landing", "fastest_contact", "samples", "outside", "check"),
    }
    assert set(content["advised"]) == {
        *("scheme", "steps", "tolerance", "error_radii", "keeps", "basis", "evidence", "evaluations", "run_time_s"),
        *("omega_h", "stability_limit", "margin"),
    }
    assert from_mapping(content["scene"]).duration == 3
    assert content["options"] == [content["advised"]]


def test_an_error_nothing_keeps_is_status_1(capsys):
    status, out, _ = called(capsys, *NUMBERS, "--error", "1e-17", "--run")
    assert status == 1
    assert "scheme    none found" in out


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--error", "lots"], "--error = lots: allowed is a part of the radius above 0"),
        (["--error", "200%"], "--error = 200%: allowed"),
        (["--horizon", "11"], "horizon = 11: allowed is up to the scene's duration, 10 s"),
        (["--horizon", "0"], "horizon = 0.0: allowed is a finite number > 0 [s]"),
        (["--scheme", "magic"], "scheme = magic: allowed is symplectic_euler"),
        (["--scheme", "exact", "--spin", "1,0,0"], "scheme = exact, model = tumbling: allowed"),
        (["--mass", "-1"], "cube.mass = -1: allowed is a finite number > 0 [kg]"),
        (["--velocity", "5"], "launch.velocity = [5]: allowed are three"),
        (["nowhere.yaml"], "nowhere.yaml: No such file"),
        (["-o", "out.h5"], "-o: a file is written with --run only"),
    ],
)
def test_bad_input_is_one_line_and_status_2(capsys, arguments, told):
    status, out, err = called(capsys, "--contact", "gated", *arguments)
    assert (status, out) == (2, "")
    assert told in err
    assert err.count("\n") == 1


def test_no_command_without_an_advice():
    assert command(dataclasses.replace(advise(scene(), 1e-2, scheme="event"), best=None), ["a.yaml"]) == ""


def test_a_pilot_that_takes_too_long_ends_and_advice_with_it():
    """A cube that chatters on stiff ground costs event a step for every swing."""
    advice = advise(resting(stiffness=1e8), 1e-3, scheme="event", patience=200_000)
    assert 0 < advice.horizon < 3
    assert "takes more than 200,000 force evaluations" in advice.cut
    again = advise(resting(stiffness=1e8), 1e-3, scheme="event", patience=200_000)
    assert (again.horizon, again.best.tolerance, again.floor) == (advice.horizon, advice.best.tolerance, advice.floor)
    assert check(advice, run_advised(advice, advice.best)).kept


def test_what_takes_too_long_is_no_option_where_another_scheme_knows_the_path():
    launch = {"position": [0, 0, 0.5177], "velocity": [0.3, 0, 0], "node_velocity": "rigid"}
    quiet = scene(stiffness=1e12, damping=2e3, friction=0, launch=launch)
    advice = advise(quiet, 1e-6, scheme="event", patience=100_000)
    (option,) = advice.options
    assert (advice.best, option.keeps, option.error) == (None, False, None)
    assert "takes more than" in option.evidence
    assert advise(quiet, 1e-6, scheme="exact").best.error < 1e-9


def held(**changes):
    """Friction so strong that it holds corners, each landing at another phase of it."""
    keys = {
        "ground": {"stiffness": 2e4, "damping": 6, "friction": 0.86, "contact": "gated"},
        "launch": {
            "position": [0, 0, 2.124],
            "velocity": [2.61, -1.72, 1.43],
            "angular_momentum": [-0.04, 0.34, 1.3],
            "orientation": [0.53, -0.35, 1.28],
            "node_velocity": "rigid",
        },
        "duration": 3,
    }
    return from_mapping(keys | changes)


def off_scipy(advice, run):
    """Return how far a run is off SciPy's LSODA at the finest tolerance [radii]."""
    kept = run.trajectory.step % (run.steps // SAMPLES) == 0
    theirs = simulate(
        advice.scene, model=advice.model, simulator="scipy", tolerance=schemes.FINEST, steps=SAMPLES, every=1
    ).trajectory.state["position"]
    return curve(run.trajectory.state["position"][kept], theirs, advice.scene.cube.radius)[-1]


@pytest.mark.parametrize("error", [1e-8, 1e-7, 1e-5])
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


def test_the_floor_is_at_least_what_two_methods_differ_by():
    pilot = flown(held())
    assert pilot.other.scheme == "lsoda"
    assert (pilot.floor >= pilot.error(pilot.other)).all()
    assert flown(flat()).other.scheme == "event"


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
