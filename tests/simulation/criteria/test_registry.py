"""The registry, and the chain through which all are called: who is asked, what is decided when, how a run ends."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.state import start_of
from stiffdice.errors import InputError
from stiffdice.report.figures import style
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.criteria import judge
from stiffdice.simulation.criteria.registry import (
    CRITERIA,
    MEMORY,
    criteria_of,
    holds,
    limits_of,
    open_of,
    tolerances_of,
    values,
)
from stiffdice.simulation.initial_conditions import phased
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.reference_run import references
from stiffdice.simulation.run import simulate

NAMES = list(CRITERIA)


def test_every_criterion_says_all_that_is_asked_of_it():
    assert NAMES == ["finite", "energy", "apex", "restitution", "trajectory"]
    assert len({part.MEASURE for part in CRITERIA.values()}) == len(CRITERIA)
    for name, part in CRITERIA.items():
        assert MEMORY[name].shape == (part.SLOTS,)
        assert isinstance(part.FAILURE, Verdict)
        assert np.isfinite(part.BASE + part.TOLERANCE)
        assert style.criterion_words(name, part.TOLERANCE)
        assert set(style.CRITERION_LOOKS[name]) == {"color", "line", "first", "last"}
    assert len({tuple(look.values()) for look in style.CRITERION_LOOKS.values()}) == len(CRITERIA)


def test_bounces_mean_nothing_where_the_cube_tumbles():
    assert list(criteria_of("sliding")) == NAMES
    assert list(criteria_of("tumbling")) == ["finite", "energy", "trajectory"]


def test_what_is_asked_by_default():
    assert tolerances_of("sliding") == {"energy": 0.05, "apex": 0.02}
    assert tolerances_of("tumbling") == {"energy": 0.05}


def test_what_is_asked_is_asked_in_the_registrys_order_and_where_it_means_something():
    asked = {"trajectory": 0.1, "apex": 0.2, "energy": 0.3}
    assert list(tolerances_of("sliding", asked).items()) == [("energy", 0.3), ("apex", 0.2), ("trajectory", 0.1)]
    assert tolerances_of("tumbling", asked) == {"energy": 0.3, "trajectory": 0.1}
    assert tolerances_of("sliding", {}) == {}
    with pytest.raises(InputError, match=f"criteria.beauty: unknown; allowed are {', '.join(NAMES)}"):
        tolerances_of("sliding", {"beauty": 1})


@pytest.mark.parametrize("name", NAMES)
def test_a_criterion_holds_up_to_its_tolerance(name):
    base = CRITERIA[name].BASE
    measures = base + np.array([0, 0.25, 0.25000001, np.inf, np.nan])
    assert holds(name, measures, 0.25).tolist() == [True, True, False, False, False]
    assert not holds(name, np.nan, 1e300)
    limits = dict(zip(NAMES, limits_of({name: 0.25}), strict=True))
    assert limits == {other: base + 0.25 if other == name else np.inf for other in NAMES}


def test_a_run_is_open_as_long_as_a_criterion_that_is_to_end_it_is_undecided():
    memory = np.zeros(1, MEMORY)
    memory["limits"] = np.inf
    assert open_of(memory[0]) == 1
    memory["decided"][0, 0] = 7
    assert open_of(memory[0]) == 1
    memory["limits"][0, :3] = 1.0
    assert open_of(memory[0]) == 2
    memory["decided"][0, 1:3] = 8
    assert open_of(memory[0]) == 0


def test_values_are_the_first_slots_and_copies():
    memory = np.zeros(2, MEMORY)
    memory["apex"][:, 0] = [1.5, 2.5]
    found = values(memory)
    assert list(found) == [part.MEASURE for part in CRITERIA.values()]
    assert found["apex_ratio"].tolist() == [1.5, 2.5]
    memory["apex"] = 0
    assert found["apex_ratio"].tolist() == [1.5, 2.5]


H = 2.0**-11  # of times that doubles hold exactly
STIFF = from_mapping({"ground": {"stiffness": 3e6, "contact": "gated", "friction": 0.3}, "duration": 8.0})  # ωh = 1.7
STOP = {"finite": 0.0, "energy": 0.05, "apex": 0.02, "restitution": 0.05}


def shortened(steps, **options):
    """The same run, only as far as so many steps."""
    scene = from_mapping(STIFF.as_mapping() | {"duration": steps * H})
    return simulate(scene, model="sliding", steps=steps, **options)


@pytest.mark.parametrize("every", [None, 1])
def test_decided_is_the_first_step_at_which_a_criterion_fails(every):
    run = shortened(16384, stop=STOP, every=every)
    decided = dict(zip(NAMES, run.decided[0], strict=True))
    assert decided["finite"] == 0
    assert len({step for step in decided.values() if step > 0}) > 1
    for name in ("energy", "apex", "restitution"):
        at = decided[name]
        assert at > 0, name
        measure = CRITERIA[name].MEASURE
        before = shortened(at - 1, every=every).measures[measure]
        after = shortened(at, every=every).measures[measure]
        assert holds(name, before, STOP[name])
        assert not holds(name, after, STOP[name])


def test_decided_is_no_step_that_the_criterion_only_would_have_been_asked_at():
    """Without a limit nothing fails, and without a horizon nothing settles."""
    assert shortened(16384).decided[0].tolist() == [0, 0, 0, 0, 0]
    assert shortened(16384, stop={"apex": 0.02}).decided[0, [0, 1, 3, 4]].tolist() == [0, 0, 0, 0]


@pytest.mark.parametrize("asked", [("energy",), ("apex",), ("energy", "apex"), ("energy", "apex", "restitution")])
def test_a_run_stops_at_the_step_that_decides_the_last_criterion_asked(asked):
    stop = {name: STOP[name] for name in asked}
    whole, stopped = shortened(16384, stop=STOP), shortened(16384, stop=stop)
    steps = {name: whole.decided[0, NAMES.index(name)] for name in asked}
    assert whole.steps_done[0] == 16384  # `finite` keeps it going
    assert stopped.steps_done[0] == max(steps.values()) < 16384
    assert {name: stopped.decided[0, NAMES.index(name)] for name in asked} == steps
    np.testing.assert_array_equal(stopped.end, shortened(int(stopped.steps_done[0])).end)
    for name in asked:
        assert not holds(name, stopped.measures[CRITERIA[name].MEASURE], stop[name])


def test_without_stop_a_run_goes_to_its_end_however_it_fails():
    run = shortened(16384, criteria=STOP)
    assert run.steps_done[0] == 16384
    assert run.verdict[0] == Verdict.ENERGY_GREW


def test_a_criterion_that_holds_keeps_a_run_going():
    run = simulate(from_mapping({}), model="sliding", steps=10_000, stop={"energy": 0.05, "apex": 0.02})
    assert run.steps_done[0] == 10_000
    assert run.verdict[0] == Verdict.PASSED


def test_members_stop_each_on_its_own():
    stop = {"energy": 0.02}
    scene = from_mapping({"ground": {"stiffness": 1e6, "contact": "gated"}})
    members = phased(scene, "sliding", 17_000, 16)
    together = simulate(scene, model="sliding", steps=17_000, members=members, stop=stop)
    assert len(set(together.steps_done)) > 3
    failed = together.steps_done < 17_000
    np.testing.assert_array_equal(failed, ~holds("energy", together.measures["energy_ratio"], 0.02))
    np.testing.assert_array_equal(together.decided[:, 1], np.where(failed, together.steps_done, 0))


def test_a_stopped_run_is_judged_by_what_it_was_asked():
    """Stopping at one tolerance, judged at another: the verdict is that of what was seen until then."""
    lax = shortened(16384, stop={"energy": 0.05}, criteria={"energy": 1e6})
    assert lax.steps_done[0] < 16384
    assert lax.verdict[0] == Verdict.PASSED
    assert lax.tolerances == {"energy": 1e6}


def test_trajectory_and_the_others_share_the_decision():
    """The run goes on past the horizon until the others are decided, too."""
    scene = from_mapping({"ground": {"stiffness": 1e6, "contact": "gated"}})
    compared, _ = references(scene, "sliding", start_of(scene, "sliding"), 1.0)
    stop = {"energy": 0.05, "trajectory": 0.05}
    run = simulate(scene, model="sliding", steps=15_000, references=compared, stop=stop, criteria=stop)
    at_energy, at_horizon = run.decided[0, 1], run.decided[0, 4]
    assert 1500 < at_horizon < 1510
    assert run.steps_done[0] == max(at_energy, at_horizon)
    assert holds("trajectory", run.measures["trajectory_error"], 0.05)


def test_the_judge_asks_the_same_tolerances():
    run = shortened(16384, stop=STOP, criteria=STOP)
    again = judge.judge(STOP, run.measures, {})
    np.testing.assert_array_equal(again, run.verdict)
