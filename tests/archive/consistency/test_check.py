from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from tests import rounds

from stiffdice.archive.consistency import check as sanity
from stiffdice.archive.consistency import equations
from stiffdice.archive.verify import verify
from stiffdice.integrators.registry import SCHEMES
from stiffdice.io.reader import open_file, parts
from stiffdice.io.writer import write_dataset
from stiffdice.report import file_page
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation import energy_budget
from stiffdice.simulation.dataset import run_dataset
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import simulate
from stiffdice.sweep import stability_limits
from stiffdice.sweep.collect import collect
from stiffdice.sweep.shard import compute_shard

BOUNCING = {
    "ground": {"contact": "gated", "stiffness": 2e3, "damping": 0.3, "friction": 0.2},
    "launch": {"position": [0, 1, 1.5], "velocity": [2, -1, 1]},
    "duration": 2.0,
}
THROWN = {**BOUNCING, "launch": {**BOUNCING["launch"], "angular_momentum": [0.2, -0.3, 0.4], "orientation": [0, 1, 1]}}


def made(scene, *, steps=2000, **options):
    run = simulate(from_mapping(scene), steps=steps, **options)
    found = run_dataset(run)
    if run.scheme in energy_budget.BOOKED:
        ledger = energy_budget.ledger(
            run.scene, model=run.model, scheme=run.scheme, steps=steps, budget=int(run.steps_done[0])
        )
        found = found.assign(ledger.data_vars)
    return found


@pytest.fixture(scope="module")
def sliding():
    """A run whose every step is kept."""
    return made(BOUNCING, model="sliding", every=1)


@pytest.fixture(scope="module")
def tumbling():
    return made(THROWN, model="tumbling", every=5)


@pytest.fixture(scope="module")
def small(plan):
    """A sweep of a few cells, one of which blows up."""
    spans = {"stiffness": {"from": 1e2, "to": 1e4, "count": 3}, "omega_h": {"from": 2.5, "to": 0.3, "count": 6}}
    return dataclasses.replace(plan, **spans, members=4, refine=0)


@pytest.fixture(scope="module", params=[True, False], ids=["early", "late"])
def shard(small, request, tmp_path_factory):
    """The runs of that sweep, ended early or not."""
    path = tmp_path_factory.mktemp("shard") / "x.h5"
    planned = dataclasses.replace(small, early_stop=request.param)
    compute_shard(planned, rounds.scan(planned), path)
    return open_file(path)


@pytest.fixture(scope="module")
def whole(small, tmp_path_factory):
    """That sweep, judged."""
    path = tmp_path_factory.mktemp("whole") / "x.h5"
    compute_shard(small, rounds.scan(small), path)
    return collect(parts(path, 7), small.criteria)


def changed(dataset, name, place, change):
    """The same with one value changed."""
    other = dataset.copy(deep=True)
    values = other[name].values.copy()
    values[place] = change(values[place])
    if name in other.indexes:
        return other.assign_coords({name: (dataset[name].dims, values, dataset[name].attrs)})
    other[name] = dataset[name].dims, values, dataset[name].attrs
    return other


def told(dataset, words):
    """That it is told, with variable and place."""
    found = sanity.problems(dataset)
    assert any(words in line for line in found), found
    assert all("\n" not in line for line in found)


def slightly(value):
    return value * (1 + 1e-9)


RUNS = {
    "spinning": (THROWN, {"model": "tumbling", "every": 1}),
    "ungated": ({**BOUNCING, "ground": {"contact": "ungated"}}, {"model": "sliding", "every": 1}),
    "vertical": (BOUNCING, {"model": "vertical", "every": 7}),
    "on a slope": (
        {**BOUNCING, "ground": {**BOUNCING["ground"], "normal": [0.2, 0, 1]}},
        {"model": "sliding", "every": 1},
    ),
    "blown up": (BOUNCING, {"model": "sliding", "every": 1, "steps": 40}),
    "out of budget": (BOUNCING, {"model": "sliding", "every": 1, "budget": 1500}),
    "blown up, and out of budget": (BOUNCING, {"model": "sliding", "every": 1, "steps": 40, "budget": 35}),
    "out of range": (
        {**BOUNCING, "ground": {"contact": "ungated", "stiffness": 1e12}, "duration": 100},
        {"model": "sliding", "every": 1, "steps": 1000},
    ),
    "far away and long": ({"launch": {"position": [1e3, 0, 90]}, "duration": 9}, {"model": "sliding", "every": 1}),
}


@pytest.mark.parametrize("name", RUNS)
def test_what_the_simulator_says_can_be(name):
    scene, options = RUNS[name]
    assert sanity.problems(made(scene, **options)) == []


OTHERS = [scheme for scheme in SCHEMES if scheme != "exact"]  # which knows no spin


@pytest.mark.long
@pytest.mark.parametrize(
    ("scheme", "model"),
    [
        ("exact", "sliding"),
        *((scheme, "tumbling") for scheme in OTHERS),
        *(pytest.param(scheme, "sliding", marks=pytest.mark.broad) for scheme in OTHERS),
    ],
)
def test_what_any_scheme_says_can_be(scheme, model):
    assert sanity.problems(made(THROWN, model=model, scheme=scheme, every=1, steps=500)) == []


def test_the_runs_here_are_no_easy_ones(sliding, tumbling):
    """They fly and bounce, so that every check has something to look at."""
    for run in (sliding, tumbling):
        assert int(run.bounce_count) > 1 and float(run.elastic_energy.max()) > 1
        assert sanity.kind_of(run) == "run" and sanity.problems(run) == []


@pytest.mark.parametrize(
    ("name", "place", "words"),
    [
        ("kinetic_energy", 100, "kinetic_energy[100] ="),
        ("potential_energy", 3, "potential_energy[3] ="),
        ("energy_paper", 7, "energy_paper[7] ="),
        ("velocity", (51, 2), "kinetic_energy[51] ="),
        ("time", 9, "time[9] ="),
        ("launch_energy", (), "sum of works ="),
        ("end_energy", (), "sum of works ="),
        ("damping_work", (), "sum of works ="),
        ("scheme_work", (), "scheme_work ="),
        ("flight_gravity_work", (), "gravity_work ="),
        ("bounce_friction_work", 1, "friction_work ="),
        ("bounce_energy_after", 0, "sum of bounce_works[0]"),
        ("bounce_start", 1, "bounce_start[1] ="),
    ],
)
def test_a_billionth_is_seen(sliding, name, place, words):
    told(changed(sliding, name, place, slightly), words)


def test_a_billionth_of_the_springs_energy_is_seen(sliding):
    k = int(sliding.elastic_energy.values.argmax())
    told(changed(sliding, "elastic_energy", k, slightly), f"elastic_energy[{k}]")


@pytest.mark.parametrize(
    ("name", "place", "words"),
    [
        ("node_offset", (200, 3, 1), "distances between nodes"),
        ("angular_momentum", (20, 0), "kinetic_energy[20] ="),
        ("angular_momentum", (0, 2), "kinetic_energy[0] ="),
        ("node_offset", (0, 5, 2), "distances between nodes"),
    ],
)
def test_a_billionth_of_a_turning_cube_is_seen(tumbling, name, place, words):
    told(changed(tumbling, name, place, slightly), words)


def test_two_states_that_changed_places_are_seen(sliding):
    order = np.arange(sliding.sizes["time"])
    order[[700, 900]] = order[[900, 700]]
    told(sliding.isel(time=order), "step[700] = 900")
    told(sliding.isel(time=order).assign_coords(time=sliding.time), "step[700] = 900")


@pytest.mark.parametrize(
    ("attribute", "value", "words"),
    [
        ("steps", 2001, "step_size ="),
        ("step_size", 1.1e-3, "step_size ="),
        ("omega_h", 0.1, "omega_h ="),
        ("criteria", "energy: energy_ratio <= 0.9", "verdict ="),
        ("criteria", "nonsense", "cannot be checked as a run: ValueError: criteria ="),
        ("scene", '{"cube": {"mass": -1}}', "cube.mass"),
        ("scene", "not JSON", "cannot be checked as a run"),
    ],
)
def test_another_attribute_is_seen(sliding, attribute, value, words):
    told(sliding.assign_attrs({attribute: value}), words)


@pytest.mark.parametrize("verdict", [v for v in Verdict if v is not Verdict.PASSED])
def test_another_verdict_is_seen(sliding, verdict):
    """Without its reason in the numbers: that is a flat passed run, kept to its end."""
    assert int(sliding.verdict) == Verdict.PASSED
    told(changed(sliding, "verdict", (), lambda _: np.int8(verdict)), "verdict =")


def test_a_run_cut_short_is_seen(sliding):
    short = sliding.isel(time=slice(1500))
    told(short, "1500 states; allowed are 2001")
    told(changed(short, "steps_done", (), lambda _: np.int64(1499)), "steps_done = 1499")


def test_a_file_without_what_it_needs_is_told_in_one_line(sliding):
    assert sanity.problems(sliding.drop_vars("velocity")) == [
        line for line in sanity.problems(sliding.drop_vars("velocity")) if line.startswith("cannot be checked as a run")
    ]
    assert sanity.problems(sliding.drop_vars("velocity"))


@pytest.mark.long
def test_shards_and_sweeps_can_be(shard, whole):
    assert {Verdict.PASSED, Verdict.ENERGY_GREW} <= set(np.unique(shard.verdict))
    for dataset, kind in ((shard, "shard"), (whole, "sweep"), (stability_limits.find(whole), "frontier")):
        assert sanity.kind_of(dataset) == kind and sanity.problems(dataset) == []


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("steps_done", lambda steps: steps + 10**6, "steps_done["),
        ("steps_done", lambda steps: -1, "steps_done["),
        ("energy_ratio", lambda ratio: 1e9, "verdict["),
        ("out_of_range", lambda flag: 1.0, "verdict["),
    ],
)
def test_a_shard_that_cannot_be_is_seen(shard, name, change, words):
    last = tuple(size - 1 for size in shard[name].shape)
    told(changed(shard, name, last, change), words)


@pytest.mark.parametrize("shard", [True], indirect=True, ids=["early"])
def test_every_verdict_of_a_shard_that_is_changed_is_seen(shard):
    """From passed to failed and back; a shard that does not say the limits is held to its sweep."""
    energy = shard.verdict.values == Verdict.ENERGY_GREW
    for place in (np.argwhere(energy)[0], np.argwhere(shard.verdict.values == Verdict.PASSED)[0]):
        flipped = Verdict.PASSED if energy[tuple(place)] else Verdict.ENERGY_GREW
        told(changed(shard, "verdict", tuple(place), lambda _, to=flipped: np.int8(to)), "verdict[")


def test_a_cell_that_is_there_twice_is_seen(shard):
    doubled = shard.isel(cell=[*range(shard.sizes["cell"]), 2])
    told(doubled, "allowed is a cell that is not there already")


@pytest.mark.parametrize(
    ("name", "place", "change", "words"),
    [
        ("failing", (0, 0), lambda n: 5, "failing[0, 0] = 5"),
        ("verdicts", (0, 0), lambda n: n + 1, "sum of verdicts[0]"),
    ],
)
def test_a_sweep_that_cannot_be_is_seen(whole, name, place, change, words):
    told(changed(whole, name, place, change), words)


def test_a_cell_cannot_pass_with_more_members_than_fail_nothing(whole):
    k = int(np.argmax(whole.verdicts.values[:, 0]))
    told(changed(whole, "failing", (0, k), lambda n: 1), f"verdicts of passed[{k}]")


def test_a_sweep_that_is_not_what_its_shards_add_up_to_is_seen(whole):
    assert equations.same_as_collected(whole, whole) == []
    count = int(whole.failing[0, 0])
    found = equations.same_as_collected(changed(whole, "failing", (0, 0), lambda n: n - 1), whole)
    assert found == [
        f"failing[0, 0] = {count - 1}: allowed is {count}, computed again (1 of {whole.failing.size} values)"
    ]
    assert equations.same_as_collected(whole.drop_vars("failing"), whole) == ["failing: is missing"]
    assert "'cell': 3}: allowed is" in equations.same_as_collected(whole.isel(cell=slice(3)), whole)[0]


@pytest.mark.parametrize("name", ["first_pass", "last_fail", "flips", "pass_fraction", "exponent", "factor", "limit"])
def test_a_frontier_that_does_not_follow_from_its_sweep_is_seen(whole, name):
    found = stability_limits.find(whole)
    assert equations.same_as_found(found, whole) == []
    place = tuple(np.argwhere(found[name].values > 0)[0])
    assert equations.same_as_found(changed(found, name, place, slightly), whole)[0].startswith(name)
    assert "model = vertical" in equations.same_as_found(found.assign_attrs(model="vertical"), whole)[0]


# The words of enums: a number in a file means what the registries say, whatever words the file has for it.

FORMATS = Path(__file__).parents[2] / "reference" / "formats"
FILES = sorted(FORMATS.glob("*/*.h5"))
NEWEST = FORMATS / "1.3"


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_files_of_every_version_have_the_words_of_the_registries(path):
    assert sanity.word_problems(open_file(path)) == []


def swapped(dataset, name, first, second):
    """The same with two words of an enum in each other's place."""
    other = dataset.copy()
    text = str(other[name].attrs["flag_meanings"]).split()
    a, b = text.index(first), text.index(second)
    text[a], text[b] = second, first
    other[name].attrs["flag_meanings"] = " ".join(text)
    return other


@pytest.mark.parametrize(
    ("kind", "name", "first", "second"),
    [
        ("run", "verdict", "passed", "energy_grew"),
        ("run", "ending", "passed", "unresolved"),
        ("run", "axis", "x", "z"),
        ("run", "bounce_ended", "in_contact", "in_air"),
        ("shard", "verdict", "passed", "energy_grew"),
        ("shard", "contact", "gated", "ungated"),
        ("shard", "criterion", "energy", "apex"),
        ("sweep", "contact", "gated", "ungated"),
        ("sweep", "criterion", "energy", "apex"),
        ("sweep", "verdict", "passed", "sank"),
        ("frontier", "criterion", "energy", "apex"),
        ("frontier", "cell_contact", "gated", "ungated"),
        ("frontier", "edge", "first_pass", "last_fail"),
    ],
)
@pytest.mark.long
def test_words_that_changed_places_are_told(kind, name, first, second, tmp_path):
    path = tmp_path / f"{kind}.h5"
    write_dataset(swapped(open_file(NEWEST / f"{kind}.h5"), name, first, second), path)
    report = verify(path)
    assert any(problem.reason.startswith(f"{name}: flag_meanings = ") for problem in report.problems), report.lines()


def test_words_that_a_later_version_adds_are_read_and_words_that_are_gone_are_not():
    run = open_file(NEWEST / "run.h5")
    known = " ".join(verdict.name.lower() for verdict in Verdict)
    run.verdict.attrs["flag_meanings"] = f"{known} exploded"
    assert sanity.word_problems(run) == []
    run.verdict.attrs["flag_meanings"] = known.replace("apex_rose ", "")
    assert sanity.word_problems(run)
    del run.verdict.attrs["flag_meanings"]
    assert sanity.word_problems(run) == [f"verdict: flag_meanings = : allowed are {known}, in this order"]


def test_a_sweep_has_the_criteria_whose_measures_it_holds():
    sweep = open_file(NEWEST / "sweep.h5")
    sweep.criterion.attrs["flag_meanings"] = "energy restitution"
    assert sanity.word_problems(sweep) == [
        "criterion: flag_meanings = energy restitution: allowed are energy apex, in this order"
    ]


@pytest.mark.parametrize(("kind", "name"), [("frontier", "criterion"), ("frontier", "edge"), ("run", "axis")])
def test_a_dimension_counts_its_words(kind, name):
    dataset = open_file(NEWEST / f"{kind}.h5")
    turned = dataset.assign_coords({name: (name, dataset[name].values[::-1], dataset[name].attrs)})
    assert any(line.startswith(f"{name} = ") for line in sanity.word_problems(turned))


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.2"])
def test_a_text_of_an_older_file_about_its_verdict_is_not_what_is_shown(version):
    run = open_file(FORMATS / version / "run.h5")
    lying = run.assign_attrs(verdict_text="energy grew: by far")
    for dataset in (run, lying):
        text = file_page.as_text(dataset, "run.h5")
        assert "  passed: every criterion that was looked at holds" in text and "energy grew" not in text


def test_a_run_of_today_does_not_say_its_verdict_twice():
    assert "verdict_text" not in open_file(NEWEST / "run.h5").attrs
