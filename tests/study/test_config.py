from __future__ import annotations

import dataclasses
import inspect
import itertools
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from stiffdice.dynamics import flat_bounce, linear_theory
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.errors import InputError
from stiffdice.integrators.registry import SCHEMES
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.scene import PRESETS
from stiffdice.simulation.backend import OURS
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.engines.registry import ENGINES, METHODS, adapter_of
from stiffdice.study import catalogue
from stiffdice.study import config as study
from stiffdice.sweep import partition as shards
from stiffdice.sweep.grid import Column

TOP = Path(__file__).parents[2]

CONFIG = Path(__file__).parents[2] / "config"
SWEEP = "sweeps.steps-needed"
SCENE = "config/scenes/figure-13.yaml"


@pytest.fixture(scope="module")
def paper():
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(CONFIG.parent)
        return study.load(CONFIG / "paper.yaml")


@pytest.fixture
def changed(tmp_path):
    """Load config/quick.yaml with some keys changed (None takes one away)."""

    def load(changes):
        data = yaml.safe_load((CONFIG / "quick.yaml").read_text())
        for path, value in changes.items():
            *above, last = path.split(".")
            part = data
            for key in above:
                part = part.setdefault(key, {})
            if value is None:
                del part[last]
            else:
                part[last] = value
        file = tmp_path / "quick.yaml"
        file.write_text(yaml.safe_dump(data))
        return study.load(file)

    return load


@pytest.fixture
def sweep_of(changed):
    """The sweep of config/quick.yaml with some of its own keys changed."""

    def load(**changes):
        return changed({f"{SWEEP}.{key}": value for key, value in changes.items()}).sweeps["steps-needed"]

    return load


@pytest.fixture(autouse=True)
def _at_the_top(monkeypatch):
    monkeypatch.chdir(CONFIG.parent)


def test_figure_13_is_the_sweep_that_was_promised(paper):
    sweep = paper.sweeps["steps-needed"]
    columns = sweep.columns()
    stiffness = sorted({column.stiffness for column in columns})
    assert len(stiffness) >= 16
    assert (stiffness[0], stiffness[-1]) == (1e2, 1e7)
    assert {column.contact for column in columns} == {"ungated", "gated"}
    assert len(columns) == 2 * len(stiffness)
    assert sweep.members >= 32
    for column in columns:
        steps = sweep.scan(column)
        assert len(set(steps)) >= 40
        omega_h = [linear_theory.omega_h(sweep.scene_of(column), n) for n in steps]
        assert min(omega_h) < 0.105
        assert max(omega_h) > 2.8


def test_step_counts_favour_no_round_numbers(paper):
    sweep = paper.sweeps["steps-needed"]
    steps = np.array([n for column in sweep.columns() for n in sweep.scan(column) if n > 1000])
    assert np.mean(steps % 10 == 0) < 0.15


def test_every_figure_of_the_paper_is_planned(paper):
    assert {f"figure-{n:02d}" for n in range(1, 14)} <= set(paper.figures)
    for number in range(4, 13):
        assert paper.runs[paper.figures[f"figure-{number:02d}"].of[0]].presets == ("as_listed", "as_written")


def test_a_column_is_run_on_its_own_ground(plan):
    scene = plan.scene_of(Column("gated", 123.0))
    assert (scene.ground.contact, scene.ground.stiffness) == ("gated", 123.0)
    assert scene.launch == plan.scene.launch


def names(sweep):
    return set(shards.of(sweep))


@pytest.mark.long
def test_a_shards_name_tells_what_it_computes(sweep_of):
    before = names(sweep_of())
    assert before == names(sweep_of()) == names(sweep_of(simulator="stiffdice")) < names(sweep_of(refine=2))
    for key, value in {
        "seed": 2,
        "members": 9,
        "set": ["cube.mass=2"],
        "early_stop": False,
        "model": "tumbling",
        "omega_h": {"from": 3, "to": 0.2, "count": 41},
        "criteria": {"energy": 0.05, "trajectory": 0.1},
        "simulator": "numpy",
    }.items():
        assert before.isdisjoint(names(sweep_of(**{key: value}))), key


@pytest.mark.parametrize(
    ("early_stop", "refine", "kept"), [(False, 0, True), (True, 0, False), (False, 1, False), (True, 1, False)]
)
@pytest.mark.long
def test_another_tolerance_needs_other_runs_only_where_runs_depend_on_it(sweep_of, early_stop, refine, kept):
    fixed = {"early_stop": early_stop, "refine": refine}
    before = names(sweep_of(**fixed, criteria={"energy": 0.05, "apex": 0.02}))
    for criteria in ({"energy": 0.05, "apex": 0.03}, {"energy": 0.05}):
        after = names(sweep_of(**fixed, criteria=criteria))
        assert (after == before) == kept
        scan = set(shards.rounds(shards.of(sweep_of(**fixed, criteria=criteria)), 0))
        assert after & before == (set() if early_stop else scan)


def test_a_horizon_matters_only_to_a_trajectory(sweep_of):
    """And asking for one needs runs that are compared."""
    free = {"early_stop": False, "refine": 0}
    bounces, path = {"apex": 0.02}, {"apex": 0.02, "trajectory": 0.05}
    assert names(sweep_of(**free, criteria=bounces)) == names(sweep_of(**free, criteria=bounces, horizon=3.0))
    assert names(sweep_of(**free, criteria=path)).isdisjoint(names(sweep_of(**free, criteria=path, horizon=3.0)))
    assert names(sweep_of(**free, criteria=path)).isdisjoint(names(sweep_of(**free, criteria=bounces)))


def test_a_stiffness_has_the_same_steps_in_another_grid_and_under_either_law(sweep_of):
    other = sweep_of(stiffness={"from": 1e3, "to": 1e5, "count": 3})
    assert len({tuple(s.scan(Column(law, 1e4))) for s in (sweep_of(), other) for law in ("gated", "ungated")}) == 1


def test_a_stiffness_may_be_one(sweep_of):
    sweep = sweep_of(stiffness=300)
    assert sweep.columns() == [Column("ungated", 300.0), Column("gated", 300.0)]


def test_steps_may_be_counts_instead(sweep_of):
    sweep = sweep_of(steps={"from": 100, "to": 200, "count": 10}, omega_h=None)
    for column in sweep.columns():
        assert 100 <= min(sweep.scan(column)) <= max(sweep.scan(column)) <= 200


def test_criteria_are_the_studys_unless_the_sweep_has_its_own(changed):
    assert changed({}).sweeps["steps-needed"].criteria == {"energy": 0.05, "apex": 0.02}
    study_wide = changed({"criteria": {"apex": 0.5}})
    assert study_wide.sweeps["steps-needed"].criteria == {"apex": 0.5}
    own = changed({"criteria": {"apex": 0.5}, f"{SWEEP}.criteria": {"energy": 0.1}})
    assert own.sweeps["steps-needed"].criteria == {"energy": 0.1}
    turning = changed({"criteria": {"apex": 0.5, "energy": 0.1}, f"{SWEEP}.model": "tumbling"})
    assert turning.sweeps["steps-needed"].criteria == {"energy": 0.1}


def test_a_horizon_is_the_duration_unless_it_is_given(sweep_of):
    assert sweep_of().horizon == 10.0
    assert sweep_of(set=["duration=4"]).horizon == 4.0
    assert sweep_of(horizon=2.5).horizon == 2.5


# How many of 8 members pass, at ascending steps.
SCANNED = [100, 200, 400, 800, 1600, 3200]
COLUMN = Column("gated", 1e4)


@pytest.mark.parametrize(
    ("passing", "expected"),
    [
        ([0, 0, 0, 8, 8, 8], [(400, 800)]),
        ([0, 8, 0, 8, 8, 8], [(100, 200), (200, 400), (400, 800)]),
        ([0, 0, 3, 8, 8, 8], [(200, 400), (400, 800)]),
        ([3, 3, 3, 3, 3, 3], list(itertools.pairwise(SCANNED))),
        ([0, 0, 0, 0, 0, 7], [(1600, 3200)]),
        ([8, 8, 8, 8, 8, 8], []),
        ([0, 0, 0, 0, 0, 0], []),
    ],
)
def test_a_scan_is_refined_where_neighbours_disagree_or_are_mixed(plan, passing, expected):
    added = plan.finer(COLUMN, SCANNED, np.array([passing]) / 8, 1)
    assert len(added) == len(expected)
    for steps, (low, high) in zip(added, expected, strict=True):
        assert low < steps < high


@pytest.mark.parametrize(
    ("early_stop", "refine", "matter"), [(True, 0, True), (False, 1, True), (True, 1, True), (False, 0, False)]
)
def test_tolerances_are_part_of_a_sweep_where_they_stop_runs_or_place_cells(plan, early_stop, refine, matter):
    config = dataclasses.replace(plan, early_stop=early_stop, refine=refine).config
    assert ("criteria" in config) == ("early_stop" in config) == matter


def test_the_range_of_steps_is_that_of_all_spans(sweep_of):
    spans = [{"from": 2.0, "to": 1.0, "count": 3}, {"from": 0.5, "to": 4.0, "count": 3}]
    fewest, most = sweep_of(omega_h=spans).step_range(1e4)
    assert (fewest, most) == pytest.approx((10 * 200 / 4, 10 * 200 / 0.5))  # ω = √(4S/m) = 200 rad/s for 10 s


def test_one_criterion_in_doubt_is_enough(plan):
    shares = np.array([[0, 0, 0, 1, 1, 1], [0, 0, 0, 0, 0, 1]])
    added = plan.finer(COLUMN, SCANNED, shares, 1)
    assert [sum(low < steps for low in SCANNED) - 1 for steps in added] == [2, 4]


def test_finer_is_jittered_by_column_round_and_seed_and_by_nothing_else(plan, sweep_of):
    shares = np.array([[0, 1, 0, 1, 0, 1]])
    wide = [1000 * steps for steps in SCANNED]
    first = plan.finer(COLUMN, wide, shares, 1)
    assert first == plan.finer(COLUMN, wide, shares, 1)
    assert first == plan.finer(Column("ungated", 1e4), wide, shares, 1)
    assert set(first).isdisjoint(plan.finer(COLUMN, wide, shares, 2))
    assert set(first).isdisjoint(plan.finer(Column("gated", 1e5), wide, shares, 1))
    assert set(first).isdisjoint(sweep_of(seed=2).finer(COLUMN, wide, shares, 1))


@given(st.lists(st.integers(0, 8), min_size=1, max_size=12), st.integers(1, 5))
def test_finer_never_repeats_and_never_leaves_the_scan(plan, passing, rounds):
    """Neighbours next to each other leave no room: nothing is added there, and nothing twice."""
    scanned = list(range(7, 7 + len(passing)))
    assert plan.finer(COLUMN, scanned, np.array([passing]) / 8, rounds) == []
    spread = [n * n for n in scanned]
    added = plan.finer(COLUMN, spread, np.array([passing]) / 8, rounds)
    assert added == sorted(set(added) - set(spread))
    assert all(spread[0] < steps < spread[-1] for steps in added)


@pytest.mark.parametrize(
    ("path", "value", "told"),
    [
        (f"{SWEEP}.members", 0, f"{SWEEP}.members = 0: allowed is a whole number from 1"),
        (f"{SWEEP}.members", "many", f"{SWEEP}.members = many: allowed is a whole number"),
        (f"{SWEEP}.members", None, f"{SWEEP}.members is missing"),
        (f"{SWEEP}.membrs", 3, f"{SWEEP}.membrs: unknown key; allowed are"),
        (f"{SWEEP}.steps", {"from": 1, "to": 2, "count": 1}, f"{SWEEP}: give one of steps and omega_h"),
        (f"{SWEEP}.omega_h", None, f"{SWEEP}: give one of steps and omega_h"),
        (f"{SWEEP}.stiffness", -1, f"{SWEEP}.stiffness = -1: allowed is a finite number > 0 [kg/s²], or {{from"),
        (f"{SWEEP}.stiffness.from", -1, "allowed is a finite number > 0"),
        (f"{SWEEP}.stiffness.from", float("nan"), f"{SWEEP}.stiffness.from = nan: allowed is a finite number"),
        (f"{SWEEP}.stiffness.to", float("inf"), "allowed is a finite number > 0"),
        (f"{SWEEP}.stiffness.to", 1, f"{SWEEP}: stiffness.from = 100: allowed is a number <= to = 1 [kg/s²]"),
        (
            f"{SWEEP}.stiffness",
            [{"from": 1, "to": 2, "count": 2}, {"from": 5, "to": 4, "count": 2}],
            f"{SWEEP}: stiffness.from = 5: allowed is a number <= to = 4 [kg/s²]",
        ),
        (f"{SWEEP}.model", "slidng", "or auto; did you mean sliding?"),
        (f"{SWEEP}.set", ["ground.restitution=0.5"], f"{SWEEP}: scene: its ground.restitution is that of stiffness"),
        ("figures.frontier.draw", "fronteir", "; did you mean frontier?"),
        ("figures.frontier.of", ["step-needed"], "allowed is steps-needed; did you mean steps-needed?"),
        (f"{SWEEP}.omega_h.to", float("inf"), f"{SWEEP}.omega_h.to = inf: allowed is a finite number > 0"),
        (f"{SWEEP}.omega_h.count", 0, f"{SWEEP}.omega_h.count = 0: allowed is a whole number from 1"),
        (f"{SWEEP}.contact", ["sticky"], f"{SWEEP}.contact.0 = sticky: allowed is ungated or gated"),
        (f"{SWEEP}.contact", [], f"{SWEEP}.contact = []"),
        (f"{SWEEP}.contact", "gated", f"{SWEEP}.contact = gated: allowed is a list of different contact laws"),
        (f"{SWEEP}.model", "falling", f"{SWEEP}.model = falling: allowed is vertical or sliding or"),
        (f"{SWEEP}.model", "flying", f"{SWEEP}: model = flying: allowed for scenes in which the ground never acts"),
        ("runs.figure-04.model", "flying", "runs.figure-04: model = flying: allowed for scenes"),
        (f"{SWEEP}.scene", "nowhere.yaml", "nowhere.yaml: No such file"),
        (f"{SWEEP}.set", ["ground.S=1"], "ground.S"),
        (f"{SWEEP}.set", ["ground.stiffness=3"], "the sweep sets this itself, from its key stiffness"),
        (f"{SWEEP}.set", ["ground.contact=gated"], "the sweep sets this itself, from its key contact"),
        (f"{SWEEP}.set", ["launch.position=[0, 0, 0.1]"], f"{SWEEP}: members = 8: they are spread over the phase"),
        (f"{SWEEP}.omega_h.to", 1e-300, f"{SWEEP}: omega_h: asks for up to"),
        (f"{SWEEP}.refine", 21, f"{SWEEP}.refine = 21: allowed is a whole number from 0 to 20"),
        (f"{SWEEP}.refine", -1, f"{SWEEP}.refine = -1: allowed is a whole number from 0 to 20"),
        (f"{SWEEP}.early_stop", 3, f"{SWEEP}.early_stop = 3: allowed is true or false"),
        (f"{SWEEP}.horizon", 11, f"{SWEEP}: horizon = 11: allowed is a number <= duration = 10 [s]"),
        (f"{SWEEP}.horizon", 0, f"{SWEEP}.horizon = 0: allowed is a finite number > 0 [s]"),
        (f"{SWEEP}.seconds_per_job", 0, f"{SWEEP}.seconds_per_job = 0: allowed is a number from 1e-9 to 1e6 [s]"),
        (f"{SWEEP}.seconds_per_job", 1e-300, f"{SWEEP}.seconds_per_job = 1e-300: allowed is a number from 1e-9 to 1e6"),
        (f"{SWEEP}.scene", "\0", r"\x00: allowed is text without NUL and surrogates"),
        (f"{SWEEP}.scene", "\ud800", r"\ud800: allowed is text without NUL and surrogates"),
        ("runs.figure-04.scene", "\0", r"\x00: allowed is text without NUL and surrogates"),
        (
            f"{SWEEP}.omega_h",
            [],
            f"{SWEEP}.omega_h = []: allowed is {{from, to, count}}, or a list of such",
        ),
        (f"{SWEEP}.criteria", {"energy": -1}, f"{SWEEP}.criteria.energy = -1: allowed is a number from 0 to 1e6"),
        (f"{SWEEP}.criteria", {"beauty": 1}, f"{SWEEP}: criteria.beauty: unknown; allowed are finite, energy, apex"),
        (f"{SWEEP}.criteria", {}, f"{SWEEP}.criteria = {{}}: allowed are criteria, each with its tolerance"),
        ("sweeps.Steps", {}, "sweeps.Steps"),
        ("criteria", {"beauty": 1}, "criteria.beauty: unknown; allowed are finite, energy, apex"),
        ("question", "", "question = "),
        ("question", None, "question is missing"),
        ("dpi", 5, "dpi = 5: allowed is a whole number from 50 to 1200"),
        ("runs.figure-04.steps", 0, "runs.figure-04.steps = 0: allowed is a whole number from 1 to"),
        ("runs.figure-04.every", 30_000, "runs.figure-04: every = 30000"),
        ("runs.figure-04.presets", ["corrected"], "state cube.inertia"),
        ("runs.Figure 4", {"scene": "x", "model": "sliding", "steps": 1}, "Figure 4"),
        ("figures.energy.run", "figure-99", "figures.energy.run = figure-99: allowed is figure-04 or figure-09"),
        ("figures.energy.run", None, "figures.energy.run is missing: energy needs names of runs"),
        (
            "figures.energy.of",
            ["steps-needed"],
            "figures.energy.of = ['steps-needed']: energy shows none of these; name runs with `run`",
        ),
        ("figures.energy.draw", "cube-start", "figure-09: cube-start needs a run of model tumbling"),
        ("figures.frontier.run", "figure-04", "figure-04: frontier shows none of these; name sweeps with `of`"),
        ("figures.frontier.of", ["other"], "figures.frontier.of = other: allowed is steps-needed"),
        ("figures.frontier.of", None, "figures.frontier.of is missing: frontier needs names of sweeps"),
        ("figures.frontier.of", [], "figures.frontier.of = []: allowed is a list of different names"),
        ("sweeps", None, "figures.frontier.of = steps-needed: allowed is none: this study has no sweeps"),
        ("figures.Big Figure", {"draw": "frontier", "title": "x"}, "figures.Big Figure: allowed names have small"),
        (
            "tables.t",
            {"tell": "paper-questions", "of": ["other"], "title": "x"},
            "tables.t.of = other: allowed is steps-needed",
        ),
        ("tables.t", {"tell": "paper-questions", "title": "x"}, "tables.t.of is missing"),
        ("tables.t", {"tell": "paper-questions", "of": [], "title": "x"}, "tables.t.of = []: allowed is a list"),
    ],
)
def test_bad_studies_end_with_one_line(changed, path, value, told):
    with pytest.raises(InputError) as caught:
        changed({path: value})
    assert told in str(caught.value)
    assert "quick.yaml: " in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_sweep_of_the_ground_that_a_restitution_is_for_has_it(changed):
    change = {
        f"{SWEEP}.set": ["ground.restitution=0.5", "cube.side=1 m"],
        f"{SWEEP}.stiffness": 1e4,
        f"{SWEEP}.contact": ["gated"],
    }
    planned = changed(change).sweeps["steps-needed"]
    (column,) = planned.columns()
    scene = planned.scene_of(column)
    assert flat_bounce.restitution(dataclasses.replace(scene, gravity=0), 1.0) == pytest.approx(0.5, rel=1e-12)


def test_a_study_that_is_not_there_is_told_with_those_that_are(tmp_path):
    told = r"config/stabilty.yaml: there is no study stabilty; .* quick, .*stability.*; did you mean stability\?$"
    with pytest.raises(InputError, match=told):
        study.load(CONFIG / "stabilty.yaml")
    with pytest.raises(InputError, match=f"there is no study x; {tmp_path}/ has none$"):
        study.load(tmp_path / "x.yaml")


ROCKING = {"measure": "rocking", "scene": SCENE}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"measure": "beauty"}, f"measure = beauty: allowed is {' or '.join(catalogue.EXPERIMENTS)}"),
        ({"scene": "nowhere.yaml"}, "nowhere.yaml: No such file"),
        ({"set": ["cube.mass=-1"]}, "cube.mass = -1"),
        ({"set": ["ground.restitution=0.5"]}, "scene: its ground.restitution is that of stiffness 10000 kg/s²"),
        ({"options": {"stepz": 3}}, "options.stepz: unknown key; allowed are"),
        ({"options": {"steps": "many"}}, "options.steps = many: allowed is a whole number"),
        ({"options": {"steps": 0}}, "options.steps = 0: allowed is a whole number from 1"),
        ({"measure": "work-precision", "options": {"methods": [1]}}, "methods = 1: allowed is a word, as all"),
        ({"options": {"zeta": 0.3}}, "options.zeta = 0.3: allowed is a list of numbers"),
        ({"options": {"zeta": []}}, "options.zeta = []: allowed is a list of numbers"),
        ({"options": {"zeta": [0.1, "x"]}}, "options.zeta = the text 'x': allowed is a finite number >= 0"),
    ],
)
def test_bad_experiments_end_with_one_line(changed, change, told):
    with pytest.raises(InputError) as caught:
        changed({"experiments.rock": ROCKING | change})
    assert told in str(caught.value).partition("quick.yaml: experiments.rock: ")[2]
    assert "\n" not in str(caught.value)


def test_an_experiment_is_planned_with_its_options(changed):
    options = {"zeta": [0.0, 0.5], "steps": 200}
    planned = changed({"experiments.rock": ROCKING | {"set": ["cube.mass=2"], "options": options}}).experiments["rock"]
    assert planned == ("rocking", SCENE, ("cube.mass=2",), options)


def test_a_figure_shows_only_experiments_of_its_kind(changed):
    both = {"experiments.rock": ROCKING, "figures.x": {"draw": "rocking", "of": ["rock"], "title": "x"}}
    assert changed(both).figures["x"] == ("rocking", ("rock",), "x", ())
    both["figures.x"] = {"draw": "energy-budget", "of": ["rock"], "title": "x"}
    with pytest.raises(
        InputError, match=r"figures.x.of = rock: energy-budget shows only experiments that measure energy-budget"
    ):
        changed(both)


@pytest.mark.parametrize(
    ("changes", "key", "allowed"),
    [
        ({"figures.x": {"draw": "poetry", "run": "figure-04", "title": "x"}}, "figures.x.draw", catalogue.DRAWINGS),
        ({"tables.x": {"tell": "poetry", "of": ["steps-needed"], "title": "x"}}, "tables.x.tell", catalogue.TABLES),
    ],
)
def test_a_name_that_is_in_no_registry_is_told_with_those_that_are(changed, changes, key, allowed):
    with pytest.raises(InputError) as caught:
        changed(changes)
    assert str(caught.value).endswith(f"quick.yaml: {key} = poetry: allowed is {' or '.join(allowed)}")


ENTRIES = {
    f"{kind} {name}": entry
    for kind, registry in (
        ("drawing", catalogue.DRAWINGS),
        ("table", catalogue.TABLES),
        ("experiment", catalogue.EXPERIMENTS),
        ("timing", catalogue.TIMINGS),
    )
    for name, entry in registry.items()
}


@pytest.mark.parametrize("name", ENTRIES)
def test_everything_in_the_catalogue_is_there(name):
    """And takes what its registry says: data and a title, or a scene and options, each with a default."""
    parameters = list(inspect.signature(ENTRIES[name].load()).parameters.values())
    if name.startswith(("experiment", "timing")):
        assert parameters[0].name == "scene"
        options = parameters[1:]
        assert all(part.kind is part.KEYWORD_ONLY for part in options)
        assert all(part.default is not part.empty for part in options)
    else:
        _, title, *options = parameters
        assert title.name == "title"
        assert all(part.default is not part.empty for part in options)


def test_what_a_drawing_shows_can_be_had():
    for entry in [*catalogue.DRAWINGS.values(), *catalogue.TABLES.values()]:
        assert entry.given in ("runs", "sweeps", "experiments", "timings")
        assert entry.given != "experiments" or entry.measures in catalogue.EXPERIMENTS
        assert entry.measures in catalogue.TIMINGS or not (entry.given == "timings" or entry.timed)
        assert not entry.measures or entry.given in ("experiments", "timings")


DROPPED = "launch.velocity=[0, 0, 5]"


def test_auto_is_resolved_from_the_sweeps_scene(sweep_of):
    asked = sweep_of()
    assert asked.model_reason == "as asked"
    slid = sweep_of(model="auto", set=["ground.friction=0"])
    assert (slid.model, slid.model_reason[:9]) == ("sliding", "sliding: ")
    dropped = sweep_of(model="auto", set=[DROPPED])
    assert dropped.model == "vertical"
    assert dropped.criteria == asked.criteria
    thrown = sweep_of(model="auto", criteria={"energy": 0.1, "apex": 0.1})
    assert (thrown.model, list(thrown.criteria)) == ("tumbling", ["energy"])
    # The reason is in the file, so that a file made for another is made anew.
    assert names(dropped).isdisjoint(names(sweep_of(model="vertical", set=[DROPPED])))


def test_auto_is_exact_in_every_column_of_a_sweep(sweep_of):
    """Soft ground lets the cube sink past its centre; and the law of the listings drags where nothing else acts."""
    soft = sweep_of(model="auto", set=[DROPPED], stiffness={"from": 10, "to": 1e4, "count": 3})
    assert soft.model == "tumbling"
    short = [DROPPED, "duration=1"]
    assert sweep_of(model="auto", set=short, contact=["gated"]).model == "flying"
    assert sweep_of(model="auto", set=short).model == "vertical"


def test_auto_is_resolved_for_each_reading_of_a_run(changed):
    planned = changed({"runs.figure-09.model": "auto", "figures.energy.draw": "cube-start"})
    assert planned.runs["figure-09"].model == "auto"  # as listed and as written may require different ones


@pytest.mark.parametrize(
    ("key", "wrong", "named", "allowed"),
    [
        ("model", "sticky", "model = sticky", [*MODELS, "auto"]),
        ("scheme", [1], "scheme = [1]", SCHEMES),
        ("simulator", 3, "simulator = 3", [OURS, *ENGINES]),
        ("contact", ["gated", "sticky"], "contact.1 = sticky", CONTACT_LAWS),
    ],
)
def test_a_study_may_name_what_the_code_knows(changed, key, wrong, named, allowed):
    with pytest.raises(InputError) as error:
        changed({f"{SWEEP}.{key}": wrong})
    assert str(error.value).endswith(f"{SWEEP}.{named}: allowed is {' or '.join(allowed)}")


def test_the_schema_names_nothing_that_a_registry_names():
    """Names are looked up when a study is read; presets, part of the paper, are written there."""
    text = Path(study.__file__).with_name("study.schema.yaml").read_text()
    assert yaml.safe_load(text)["$defs"]["run"]["properties"]["presets"]["items"]["enum"] == list(PRESETS)
    looked_up = (catalogue.DRAWINGS, catalogue.TABLES, catalogue.EXPERIMENTS, catalogue.TIMINGS, CRITERIA)
    for registry in (*looked_up, MODELS, SCHEMES, ENGINES, CONTACT_LAWS):
        assert not [name for name in registry if re.search(rf"[ \[]{name}[,\]]", text)]


@pytest.mark.parametrize("tilt", ["launch.orientation=[0.3, 0.2, 0]", "ground.normal=[0.2, 0, 1]"])
def test_restitution_is_not_asked_where_it_is_not_known(sweep_of, tilt):
    with pytest.raises(InputError, match=r"criteria\.restitution: .*lands tilted"):
        sweep_of(set=[tilt], criteria={"restitution": 0.05})
    assert sweep_of(set=[tilt], criteria={"energy": 0.05})
    assert sweep_of(set=["launch.orientation=[0, 0, 0.7]"], criteria={"restitution": 0.05})


def test_a_sweeps_ground_is_not_set_by_the_back_door(sweep_of):
    with pytest.raises(InputError, match="the sweep sets this itself"):
        sweep_of(set=["ground={stiffness: 5}"])


def test_a_criterion_that_is_none_is_told_though_no_sweep_asks_it(changed):
    with pytest.raises(InputError, match=r"criteria\.speed: unknown; allowed are finite, energy"):
        changed({"criteria": {"speed": 1}, "sweeps": None, "figures": None})


@pytest.mark.parametrize("kind", ["runs", "sweeps"])
def test_a_scheme_that_does_not_apply_is_told_when_the_study_is_read(kind, tmp_path):
    data = yaml.safe_load((TOP / "config/quick.yaml").read_text())
    part = {"scene": str(TOP / "config/scenes/figure-04.yaml"), "model": "tumbling", "scheme": "exact"}
    if kind == "runs":
        data["runs"] = {"one": part | {"steps": 10}}
    else:
        name = next(iter(data["sweeps"]))
        data["sweeps"][name] |= part
        data["sweeps"][name]["criteria"] = {"energy": 0.05}
    path = tmp_path / "wrong.yaml"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(InputError, match=f"{kind}.*scheme = exact, model = tumbling: allowed is a model that does not"):
        study.load(path)


@pytest.fixture
def without():
    """Make engines as if they were not installed."""

    def failing():
        raise ModuleNotFoundError

    with pytest.MonkeyPatch.context() as patch:

        def remove(*engines):
            for engine in engines:
                patch.setitem(METHODS, engine, METHODS[engine]._replace(load=failing))
            adapter_of.cache_clear()

        yield remove
    adapter_of.cache_clear()


def test_an_engine_brings_its_own_scheme(sweep_of, changed):
    assert sweep_of(simulator="scipy").scheme == "lsoda"
    assert sweep_of(simulator="numpy", scheme="symplectic_euler").scheme == "symplectic_euler"
    run = changed({"runs.figure-09.simulator": "scipy"}).runs["figure-09"]
    assert (run.simulator, run.scheme) == ("scipy", "lsoda")
    for path, told in (("runs.figure-09", "runs.figure-09"), (SWEEP, SWEEP)):
        with pytest.raises(InputError, match=f"{told}: simulator = numpy: scheme = rk4: allowed is symplectic_euler"):
            changed({f"{path}.simulator": "numpy", f"{path}.scheme": "rk4"})


def test_a_scene_that_an_engine_cannot_represent_is_told_when_the_study_is_read(sweep_of, monkeypatch):
    """Under each of the sweep's contact laws."""
    adapter = adapter_of("numpy")
    monkeypatch.setattr(adapter, "unfit", lambda scene, model: "no" if scene.ground.contact == "ungated" else None)
    assert sweep_of(simulator="numpy", contact=["gated"]).simulator == "numpy"
    with pytest.raises(InputError, match=f"{SWEEP}: simulator = numpy: no"):
        sweep_of(simulator="numpy")


def test_what_needs_an_engine_that_is_not_installed_is_left_out_with_a_line(changed, without):
    """And with it what would have nothing left to show; the rest of the study is there."""
    without("drake", "mujoco")
    ours = changed({}).sweeps["steps-needed"]
    sweep = yaml.safe_load((CONFIG / "quick.yaml").read_text())["sweeps"]["steps-needed"]
    run = {"scene": "config/scenes/figure-09.yaml", "model": "tumbling", "steps": 100}
    work = {"measure": "work-precision", "scene": "config/scenes/figure-01.yaml"}
    found = changed(
        {
            "runs.theirs": run | {"simulator": "drake"},
            "sweeps.theirs": sweep | {"simulator": "drake"},
            "experiments.both": work | {"options": {"methods": ["rk4", "mujoco", "drake"]}},
            "experiments.theirs": work | {"options": {"methods": ["mujoco"]}},
            "timings.theirs": work | {"options": {"methods": ["drake"]}},
            "figures.theirs-end": {"draw": "cube-end", "run": "theirs", "title": "x"},
            "figures.frontier.of": ["steps-needed", "theirs"],
            "figures.theirs": {"draw": "pass-fraction", "of": ["theirs"], "title": "x"},
            "figures.evaluations": {"draw": "work-precision", "of": ["both", "theirs"], "title": "x"},
            "figures.seconds": {"draw": "work-precision", "of": ["both"], "timings": ["theirs"], "title": "x"},
            "tables.theirs": {"tell": "paper-questions", "of": ["theirs"], "title": "x"},
        }
    )
    assert set(found.runs) == {"figure-04", "figure-09"}
    assert {name: vars(sweep) for name, sweep in found.sweeps.items()} == {"steps-needed": vars(ours)}
    assert {name: part.options["methods"] for name, part in found.experiments.items()} == {"both": ["rk4"]}
    assert not found.timings
    assert not found.tables
    assert {name: part.of for name, part in found.figures.items() if name not in ("position", "energy")} == {
        "frontier": ("steps-needed",),
        "evaluations": ("both",),
    }
    assert found.figures["position"].of == ("figure-04",)
    needs = "needs the package drake, which is not installed; make install-engines"
    assert found.left_out[:2] == (
        f"left out: runs.theirs: simulator = drake: {needs}",
        f"left out: sweeps.theirs: simulator = drake: {needs}",
    )
    assert f"left out: experiments.both: methods = drake: {needs}" in found.left_out
    for name in ("figures.theirs-end", "figures.theirs", "figures.seconds", "tables.theirs"):
        assert f"left out: {name}: nothing of what it shows is there" in found.left_out


def test_a_mistake_is_told_though_an_engine_is_not_installed(changed, without):
    without("drake")
    with pytest.raises(InputError, match=r"figures\.frontier\.of = others: allowed is steps-needed"):
        changed({f"{SWEEP}.simulator": "drake", "figures.frontier.of": ["others"]})
    with pytest.raises(InputError, match="simulator = dice: allowed is stiffdice or mujoco or"):
        changed({f"{SWEEP}.simulator": "dice"})
