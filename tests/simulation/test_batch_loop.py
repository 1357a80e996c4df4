from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.state import STATE, Ensemble
from stiffdice.scene import scene as scenes
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation import batch_loop
from stiffdice.simulation.criteria.registry import CRITERIA, criteria_of
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.reference_run import references
from stiffdice.simulation.run import simulate

SPIN = [0.3, 0.5, 0.2]
MODELS = ("vertical", "sliding", "tumbling")


def scene_of(contact="ungated", duration=10.0, spin=SPIN, stiffness=1e4, **keys):
    launch = {"angular_momentum": spin} | keys.pop("launch", {})
    ground = {"contact": contact, "stiffness": stiffness} | keys.pop("ground", {})
    return from_mapping({"ground": ground, "launch": launch, "duration": duration} | keys)


# Falling, with a drag that turns the cube around in one step: more energy than ever, while it touches nothing.
DRAGGED_UP = {"ground": {"damping": 500}, "launch": {"velocity": [5, 0, -5]}}
# The same of single nodes: energy comes and goes while the cube touches nothing.
DRAGGED_ABOUT = {"ground": {"damping": 60}, "launch": {"velocity": [5, 0, -1]}}
# At rest, but for its sliding, after two thirds of the run.
AT_REST = {"ground": {"damping": 3}, "launch": {"velocity": [30, 0, 0]}}

FAR_TOO_STIFF = {
    "stiffness": 2e301,
    "ground": {"damping": 0},
    "cube": {"mass": 1e-6},
    "launch": {"position": [0, 0, 1e4]},
    "spin": [0, 0, 0],
    "duration": 1000.0,
}

STOP = {name: part.TOLERANCE for name, part in CRITERIA.items() if name in ("energy", "apex", "restitution")}


@pytest.mark.parametrize(
    ("model", "scene", "steps", "stop", "verdict"),
    [
        ("vertical", scene_of(spin=[0, 0, 0], duration=5.0), 5_000, None, Verdict.PASSED),
        ("sliding", scene_of("gated", spin=[0, 0, 0], duration=2.0, stiffness=1e6), 1_000, STOP, Verdict.ENERGY_GREW),
        ("tumbling", scene_of("gated", duration=2.0), 10_000, None, Verdict.PASSED),
        ("sliding", scene_of(spin=[0, 0, 0], duration=5.0), 5_000, None, Verdict.PASSED),
        ("sliding", scene_of(spin=[0, 0, 0], duration=2.0, stiffness=1e6), 1_000, STOP, Verdict.ENERGY_GREW),
        ("sliding", scene_of(spin=[0, 0, 0], duration=2.0, **DRAGGED_UP), 1_000, STOP, Verdict.ENERGY_GREW),
        ("sliding", scene_of(**FAR_TOO_STIFF), 100, None, Verdict.LEFT_NUMERIC_RANGE),
        ("tumbling", scene_of(duration=3.0), 10_000, None, Verdict.PASSED),
        ("tumbling", scene_of(duration=3.0, stiffness=1e6, ground={"damping": 0}), 2_000, STOP, Verdict.ENERGY_GREW),
        ("tumbling", scene_of(duration=1.0, **DRAGGED_ABOUT), 66, None, Verdict.ENERGY_GREW),
        ("tumbling", scene_of(duration=2.0, stiffness=1e10), 60, None, Verdict.BLEW_UP),
        ("tumbling", scene_of(duration=3.0, ground={"normal": [0.1, 0.2, 1]}), 10_000, None, Verdict.PASSED),
    ],
)
def test_members_side_by_side_are_told_what_is_told_of_those_watched_at_every_step(model, scene, steps, stop, verdict):
    """To round-off, which has grown through the bounces."""
    members = phased(scene, model, steps, 19, turned(scene, model, 19))
    together = simulate(scene, model=model, steps=steps, members=members, stop=stop)
    watched = simulate(scene, model=model, steps=steps, members=members, stop=stop, leap=False)
    assert verdict in together.verdict
    for name in ("verdict", "decided", "steps_done"):
        np.testing.assert_array_equal(getattr(together, name), getattr(watched, name), err_msg=name)
    for name, values in together.measures.items():
        np.testing.assert_allclose(values, watched.measures[name], rtol=1e-4, atol=1e-4, err_msg=name)
    np.testing.assert_allclose(together.touchdown_phase, watched.touchdown_phase, atol=1e-9)
    assert (together.steps_computed <= watched.steps_computed).all()
    np.testing.assert_array_equal(together.evaluations, together.steps_computed)


def test_a_cube_that_has_come_to_rest_is_decided_and_stepped_no_more():
    scene, steps = scene_of(spin=[0, 0, 0], **AT_REST), 30_000
    members = phased(scene, "sliding", steps, 6)
    together = simulate(scene, model="sliding", steps=steps, members=members, stop=STOP)
    watched = simulate(scene, model="sliding", steps=steps, members=members, leap=False)
    assert (together.steps_done < steps).all()
    np.testing.assert_array_equal(together.verdict, watched.verdict)
    for name, values in together.measures.items():
        np.testing.assert_allclose(values, watched.measures[name], rtol=1e-4, atol=1e-4, err_msg=name)


def test_as_many_members_fail_where_round_off_decides_which():
    """At S = 1e6 in 10,000 steps round-off grows a hundredfold in a bounce: after some, which members gain is chance.

    Two samples of one distribution differ by more than 1.95 (2/n)^(1/2) once in a thousand times (Kolmogorov, Smirnov).
    """
    scene, steps, count = scene_of(spin=[0, 0, 0], stiffness=1e6), 10_000, 300
    members = phased(scene, "sliding", steps, count)
    together = simulate(scene, model="sliding", steps=steps, members=members)
    watched = simulate(scene, model="sliding", steps=steps, members=members, leap=False)
    assert (together.verdict != watched.verdict).any()
    for name in ("energy_ratio", "apex_ratio", "restitution_error"):
        ours, theirs = np.sort(together.measures[name]), np.sort(watched.measures[name])
        both = np.concatenate([ours, theirs])
        shares = [np.searchsorted(sample, both, side="right") / count for sample in (ours, theirs)]
        assert np.abs(shares[0] - shares[1]).max() < 1.95 * np.sqrt(2 / count)
    failing = [(verdict == Verdict.ENERGY_GREW).mean() for verdict in (together.verdict, watched.verdict)]
    assert 0.05 < failing[0] < 0.95
    assert abs(failing[0] - failing[1]) < 3 * np.sqrt(2 * failing[1] * (1 - failing[1]) / count)


@pytest.mark.parametrize("contact", ["gated", "ungated"])
def test_members_are_the_same_to_the_last_bit_whoever_is_beside_them_and_alone(contact):
    scene, steps = scene_of(contact, stiffness=1e6), 2000
    members = phased(scene, "tumbling", steps, 37, turned(scene, "tumbling", 37))
    whole = simulate(scene, model="tumbling", steps=steps, members=members)
    assert batch_loop.FEWEST == 4
    for part in (slice(None, None, -1), slice(11, 16), slice(5, 8), slice(36, 37)):
        run = simulate(scene, model="tumbling", steps=steps, members=Ensemble(*(array[part] for array in members)))
        assert run.end.tobytes() == whole.end[part].tobytes()
        for name, values in run.measures.items():
            np.testing.assert_array_equal(values, whole.measures[name][part], err_msg=name)
        np.testing.assert_array_equal(run.decided, whole.decided[part])


@pytest.mark.parametrize("contact", ["gated", "ungated"])
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("omega_h", [0.2, 1.3])
def test_every_landing_is_seen_as_in_a_run_that_is_watched_at_every_step(model, contact, omega_h):
    """Touch-downs, lift-offs, apexes, restitutions, the largest energy in the air, and the step that decides."""
    scene = scene_of(contact, 1.9 if model == "tumbling" else 3.2, stiffness=1e5)
    steps = int(scene.duration * np.sqrt(4e5) / omega_h)
    members = phased(scene, model, steps, 8, turned(scene, model, 8))
    asked = {name: 0.01 for name in ("energy", "apex", "restitution") if name in criteria_of(model)}
    for stop in (None, asked):
        fast, watched = (
            simulate(scene, model=model, steps=steps, members=members, criteria=asked, stop=stop, leap=leap)
            for leap in (None, False)
        )
        assert fast.steps_computed.sum() < watched.steps_computed.sum() or contact == "ungated"
        np.testing.assert_array_equal(fast.verdict, watched.verdict)
        np.testing.assert_allclose(fast.touchdown_phase, watched.touchdown_phase, atol=1e-7)
        for k, name in enumerate(CRITERIA):
            if name in asked:
                np.testing.assert_array_equal(fast.decided[:, k], watched.decided[:, k])
                measure = CRITERIA[name].MEASURE
                np.testing.assert_allclose(fast.measures[measure], watched.measures[measure], atol=1e-7)


def test_where_a_step_changes_nothing_the_others_are_not_taken():
    """A cube that stands where its weight and its springs are equal, to the last bit."""
    scene = scenes.changed(
        {"duration": 100.0, "gravity": 8.0},
        [
            "ground.contact=gated",
            "ground.stiffness=4096",
            "cube.geometry=exact",
            "cube.radius=0.8660254037844386",
            "launch.position=[0, 0, 0.49951171875]",
            "launch.velocity=[0, 0, 0]",
            "launch.angular_momentum=[0, 0, 0]",
        ],
    )
    run = simulate(scene, model="tumbling", steps=10_000_000)
    assert run.steps_done[0] == 10_000_000
    assert run.steps_computed[0] < 100
    np.testing.assert_array_equal(run.end["position"][0], scene.launch.position)


def test_a_cube_that_comes_to_rest_on_the_way_is_left_where_it_rests():
    """To the last bit, after some dozen steps that nobody looks at; the state told is the one it rests in."""
    scene = scenes.changed(
        {"duration": 100.0},
        [
            *("ground.contact=gated", "ground.stiffness=1000", "ground.damping=20", "ground.friction=0"),
            *("launch.position=[0, 0, 0.514]", "launch.velocity=[0, 0, 0]", "launch.angular_momentum=[0, 0, 0]"),
        ],
    )
    fast, stepped = (simulate(scene, model="tumbling", steps=10_000, leap=leap) for leap in (None, False))
    assert fast.steps_done[0] == 10_000
    assert fast.steps_computed[0] < 200
    for name in STATE.names:
        np.testing.assert_allclose(fast.end[name], stepped.end[name], rtol=0, atol=1e-15)


@pytest.mark.parametrize("contact", ["gated", "ungated"])
@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_the_trajectory_is_compared_at_every_step_that_is_taken(model, contact):
    scene = scene_of(contact, 3.0)
    launches = turned(scene, model, 5)
    compared, _ = references(scene, model, launches, 2.0)
    members = phased(scene, model, 4000, 5, launches)
    for stop in (None, {"trajectory": 0.01}):
        asked = {"steps": 4000, "members": members, "references": compared, "stop": stop}
        together, watched = (simulate(scene, model=model, leap=leap, **asked) for leap in (None, False))
        np.testing.assert_array_equal(together.verdict, watched.verdict)
        errors = (run.measures["trajectory_error"] for run in (together, watched))
        np.testing.assert_allclose(*errors, rtol=0.02)


def test_a_budget_ends_each_member_and_a_run_that_needs_less_is_not_changed_by_it():
    scene = scene_of("gated", stiffness=1e5)
    members = phased(scene, "tumbling", 20_000, 6, turned(scene, "tumbling", 6))
    asked = {"model": "tumbling", "steps": 20_000, "members": members}
    free = simulate(scene, **asked)
    most = int(np.median(free.steps_computed))
    bound = simulate(scene, budget=most, **asked)
    spent = free.steps_computed > most
    assert spent.any() and not spent.all()
    undecided = bound.verdict == Verdict.UNDECIDED
    assert undecided.any() and spent[undecided].all()
    assert (bound.steps_done[~undecided] == 20_000).all()  # a flight to the end costs nothing
    np.testing.assert_array_equal(bound.steps_computed, np.minimum(free.steps_computed, most))
    assert bound.end[~spent].tobytes() == free.end[~spent].tobytes()


def test_progress_is_told_and_changes_nothing():
    scene, told = scene_of(duration=10.0), []
    runs = [simulate(scene, model="tumbling", steps=1_000_000, progress=tell) for tell in (told.append, None)]
    assert len(told) > 2 and told == sorted(told) and told[-1] == 1.0
    assert runs[0].end.tobytes() == runs[1].end.tobytes()
