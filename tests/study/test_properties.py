"""What holds of the grid of every sweep that a study may ask for."""

from __future__ import annotations

import copy
import dataclasses
import math

import numpy as np
import pytest
import yaml
from hypothesis import Phase, given, reject, settings
from hypothesis import strategies as st
from tests.conftest import ROOT

from stiffdice.errors import InputError
from stiffdice.scene.scene import Scene
from stiffdice.study import config as study
from stiffdice.sweep import partition
from stiffdice.sweep.grid import Sweep, geometric

# A study is read in some hundredths of a second, and a failing case is known by its file.
read_each = settings(max_examples=20, phases=[Phase.explicit, Phase.reuse, Phase.generate])


@pytest.fixture(scope="module", autouse=True)
def _at_the_top():
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        yield


@pytest.fixture(scope="module")
def load(tmp_path_factory):
    """Load a study of one sweep."""
    path = tmp_path_factory.mktemp("study") / "mine.yaml"

    def read(sweep):
        path.write_text(yaml.safe_dump({"question": "How many?", "sweeps": {"mine": sweep}}))
        return path, study.load(path).sweeps["mine"]

    read.path = path
    return read


def spans(low, high, most):
    """Return spans whose ends may be in either order, or equal."""
    ends = st.floats(low, high)
    return st.fixed_dictionaries({"from": ends, "to": ends, "count": st.integers(1, most)})


stiffnesses = spans(1e-2, 1e9, 12)
base = {
    "scene": st.just("config/scenes/figure-13.yaml"),
    "model": st.just("sliding"),
    "contact": st.sampled_from([["ungated"], ["gated"], ["ungated", "gated"], ["gated", "ungated"]]),
    "stiffness": stiffnesses | st.floats(1e-2, 1e9),
    "members": st.integers(1, 4),
}
more = {
    "seed": st.integers(0, 2**40),
    "refine": st.integers(0, 3),
    "reach": st.floats(1.0, 2.0),
    "seconds_per_job": st.floats(1e-6, 1e3),
    "early_stop": st.booleans(),
    "scheme": st.sampled_from(["symplectic_euler", "rk4"]),
}
sweeps = st.fixed_dictionaries(base | {"steps": spans(1, 1e6, 30)}, optional=more) | st.fixed_dictionaries(
    base | {"omega_h": spans(1e-2, 10, 30)}, optional=more
)


def planned(asked):
    """Return the sweep that a study's keys ask for."""
    span = asked["stiffness"]
    defaults = {"scheme": "symplectic_euler", "criteria": {"energy": 0.05}, "horizon": Scene().duration}
    ours = {"scene": Scene(), "contact": tuple(asked["contact"])}
    spans = span if isinstance(span, dict) else {"from": span, "to": span, "count": 1}
    return Sweep(**(defaults | asked | ours | {"stiffness": spans}))


@read_each
@given(asked=sweeps)
@pytest.mark.long
def test_a_study_asks_for_what_is_in_its_file(load, asked):
    try:
        _, sweep = load(asked)
    except InputError:  # steps too long to spread the members over
        reject()
    assert sweep.columns() == planned(asked).columns()
    for column in sweep.columns():
        assert sweep.scan(column) == dataclasses.replace(planned(asked), scene=sweep.scene).scan(column)
    assert partition.of(load(copy.deepcopy(asked))[1]) == partition.of(sweep)


@given(sweeps)
def test_a_sweep_has_each_column_once_and_each_scan_in_its_range(asked):
    sweep = planned(asked)
    columns = sweep.columns()
    assert len(set(columns)) == len(columns)
    assert [contact for contact in asked["contact"] if any(column.contact == contact for column in columns)] == (
        asked["contact"]
    )
    span = asked["stiffness"]
    low, high = sorted((span["from"], span["to"])) if isinstance(span, dict) else (span, span)
    for column in columns:
        assert low * (1 - 1e-11) <= column.stiffness <= high * (1 + 1e-11)
        steps, (fewest, most) = sweep.scan(column), sweep.step_range(column.stiffness)
        assert steps == sorted(set(steps))
        assert 1 <= len(steps) <= int((asked.get("steps") or asked["omega_h"])["count"])
        assert max(1, math.floor(fewest * (1 - 1e-9))) <= steps[0]
        assert steps[-1] <= max(1, math.ceil(most * (1 + 1e-9)))


@given(sweeps, st.data())
def test_a_columns_scan_is_its_own_whatever_else_is_in_the_sweep(asked, data):
    """So that other shards, or a grid that became denser, change no number of it."""
    sweep = planned(asked)
    column = data.draw(st.sampled_from(sweep.columns()))
    alone = dataclasses.replace(
        sweep,
        stiffness={"from": column.stiffness, "to": column.stiffness, "count": 1},
        contact=(column.contact,),
        members=sweep.members + 1,
    )
    assert alone.scan(column) == sweep.scan(column)


@given(sweeps, st.data())
@pytest.mark.long
def test_a_shards_name_is_of_what_it_computes_and_of_nothing_else(asked, data):
    sweep = planned(asked)
    assert partition.of(planned(copy.deepcopy(asked))) == partition.of(sweep)
    other = dataclasses.replace(
        sweep, **data.draw(st.sampled_from([{"seed": sweep.seed + 1}, {"members": sweep.members + 1}]))
    )
    assert set(partition.of(other)).isdisjoint(partition.of(sweep))


@given(stiffnesses)
def test_a_geometric_grid_has_its_ends_and_even_steps(span):
    values = geometric(span)
    assert len(values) == span["count"]
    assert values[0] == pytest.approx(span["from"], rel=1e-11)
    assert span["count"] == 1 or values[-1] == pytest.approx(span["to"], rel=1e-11)
    np.testing.assert_allclose(np.diff(np.log(values), 2), 0, atol=1e-9)


@given(sweeps, st.data())
def test_a_denser_scan_lies_between_the_steps_that_disagree(asked, data):
    sweep = dataclasses.replace(planned(asked), reach=None)
    column = sweep.columns()[0]
    steps = sweep.scan(column)
    passing = np.array([[data.draw(st.sampled_from([0.0, 0.5, 1.0])) for _ in steps]])
    added = sweep.finer(column, steps, passing, 1)
    assert set(added).isdisjoint(steps)
    clear = [
        (steps[k], steps[k + 1])
        for k in range(len(steps) - 1)
        if passing[0, k] == passing[0, k + 1] and passing[0, k] in (0, 1)
    ]
    assert all(not low < step < high for low, high in clear for step in added)
    assert all(steps[0] < step < steps[-1] for step in added)


JUNK = (
    None,
    True,
    "many",
    "",
    [],
    [1],
    {},
    {"from": 1},
    math.nan,
    math.inf,
    -1,
    -0.5,
    10**400,
    {"from": 1, "to": 2, "count": 0},
)
# Some junk is no junk there.
FINE = {"early_stop": (True,), "steps": (), "stiffness": ()}


@read_each
@given(asked=sweeps, key=st.sampled_from([*base, *more]), junk=st.sampled_from(JUNK))
@pytest.mark.long
def test_a_value_that_cannot_be_is_refused_with_the_file_and_its_key(load, asked, key, junk):
    if junk in FINE.get(key, ()):
        return
    with pytest.raises(InputError) as caught:
        load(asked | {key: junk})
    told = str(caught.value)
    assert told.startswith(f"{load.path}: sweeps.mine")
    assert key in told or key == "scene"  # of a scene, its path is told
    assert told.isprintable()


@read_each
@given(
    asked=st.dictionaries(
        st.sampled_from([*base, *more, "steps", "omega_h", "set", "criteria", "horizon", "simulator", "x"]),
        st.sampled_from(JUNK) | sweeps | st.floats() | st.integers() | st.lists(st.text(max_size=4), max_size=2),
    )
)
@pytest.mark.long
def test_whatever_is_asked_it_is_a_sweep_or_refused_in_one_line(load, asked):
    try:
        assert isinstance(load(asked)[1], Sweep)
    except InputError as error:
        assert str(error).startswith(f"{load.path}: ")
        assert str(error).isprintable()


@pytest.mark.parametrize("key", ["stiffness", "steps", "omega_h"])
def test_whole_numbers_of_any_length_are_numbers(key):
    """Three of 10,000 spoilt studies had one above 2^64, of which NumPy makes no number."""
    asked = {
        "model": "sliding",
        "contact": ["gated"],
        "stiffness": 1e4,
        "members": 1,
        "omega_h": {"from": 1, "to": 2, "count": 3},
    }
    spans = [{"from": low, "to": high, "count": 3} for low, high in ((10**20, 10**21), (1e20, 1e21))]
    one, two = (
        planned(asked | {"omega_h": None} | {key: span} if key == "steps" else asked | {key: span}) for span in spans
    )
    assert one.columns() == two.columns()
    assert [one.scan(column) for column in one.columns()] == [two.scan(column) for column in two.columns()]
