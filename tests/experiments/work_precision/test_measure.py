from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError
from stiffdice.experiments.work_precision import measure as work_precision
from stiffdice.experiments.work_precision.problems import MEASURES, SAMPLES
from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.writer import write_dataset
from stiffdice.report.tables import methods as tradeoff
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.engines.registry import SOLVERS

pytestmark = pytest.mark.long

SCENE = from_mapping(
    {
        "ground": {"damping": 0.1, "friction": 0.1},
        "launch": {"angular_momentum": [0.3, 0.5, 0.2]},
        "duration": 3.0,
    },
    "as_written",
)
# Others are tried as these are; each would have to be compiled.
METHODS = ["symplectic_euler", *SOLVERS]
FLAT = {"problem": "flat-bounce", "methods": METHODS, "stiffness": [1e2, 1e8], "per_decade": 1}
FAST = {**FLAT, "stiffness": [1e2], "affordable": 0.02, "rounds": 1}


@pytest.fixture(scope="module")
def flat():
    return work_precision.measure(SCENE, **FLAT, steps=1e8)


@pytest.fixture(scope="module")
def throw():
    options = {"methods": METHODS, "stiffness": [1e2, 1e10], "per_decade": 1, "steps": 1e6, "budget": 500_000}
    return work_precision.measure(SCENE, problem="tumbling-throw", **options)


@pytest.fixture(scope="module")
def timed():
    return work_precision.time(SCENE, **FAST)


def rungs(found, method, stiffness):
    there = found.isel(method=meanings_of(found.method).index(method)).sel(stiffness=stiffness)
    return there.isel(effort=there.evaluations.values > 0)


def test_every_method_is_tried_by_every_measure(flat):
    assert meanings_of(flat.method) == METHODS
    assert meanings_of(flat.measure) == list(MEASURES)
    assert flat.evaluations.dims == ("stiffness", "method", "effort")
    done = flat.evaluations > 0
    assert done.isel(effort=0).all()
    for name in MEASURES:
        assert (np.isfinite(flat[f"{name}_error"]) <= done).all()


@pytest.mark.parametrize(("stiffness", "order"), [(1e2, 1.0), (1e8, 1.6)])
def test_the_papers_scheme_is_of_first_order_in_flight_and_needs_steps_as_the_root_of_stiffness(flat, stiffness, order):
    """Of what a bounce gains or loses the square of ωh is left, before a flight's error shows."""
    found = rungs(flat, "symplectic_euler", stiffness)
    np.testing.assert_array_equal(found.evaluations, found.steps)
    assert float(found.steps[0]) == pytest.approx(
        linear_theory.steps_for(SCENE.with_ground(stiffness=stiffness), 1.5), abs=SAMPLES
    )
    fine = found.isel(effort=slice(2, None))
    slope = np.polyfit(np.log(fine.steps), np.log(fine.position_error), 1)[0]
    assert slope == pytest.approx(-order, abs=0.3)
    assert (found.evaluations_computed < 10_000).all()  # flights, and a contact that is known


@pytest.mark.parametrize("peer", SOLVERS)
@pytest.mark.parametrize("stiffness", [1e2, 1e8])
def test_peers_come_near_the_floor_whatever_the_stiffness(flat, peer, stiffness):
    found = rungs(flat, peer, stiffness)
    np.testing.assert_allclose(found.tolerance, 10.0 ** -np.arange(2, 13))
    assert float(found.position_error[-1]) < 1e-8
    assert found.evaluations.max() < 20_000


def test_references_agree_and_say_by_how_much(flat, throw):
    for found in (flat, throw):
        assert found.attrs["reference"] == meanings_of(found.source)[0]
        assert (found.agreement.isel(source=0, measure=0) == 0).all()
        assert (found.agreement < 1e-8).all()
        assert (found.agreement.isel(source=1, measure=0) > 0).all()
        assert {"scipy_dop853", "scipy_lsoda"} <= set(meanings_of(found.source))


def test_the_floor_is_round_off_grown(flat, throw):
    for found in (flat, throw):
        low, high = found.floor.isel(bound=0), found.floor.isel(bound=1)
        assert ((low > 1e-17) & (low < 1e-12)).all()
        deep = linear_theory.contact_frequency(1.0, 1.0) * np.sqrt(found.stiffness) / 8.5
        np.testing.assert_allclose(high / low, (deep + 0 * low).transpose(*low.dims), rtol=0.05)


def test_a_ladder_ends_where_the_budget_does(throw):
    assert int(throw.evaluations_computed.max()) < 500_000
    assert rungs(throw, "symplectic_euler", 1e2).steps[-1] > 3e5
    assert rungs(throw, "scipy_radau", 1e10).sizes["effort"] < rungs(throw, "scipy_lsoda", 1e10).sizes["effort"]


def test_equal_calls_give_equal_bytes_and_files_keep_everything(flat, tmp_path):
    """Of SciPy's solvers the errors; what they count differs by two evaluations now and then, from call to call."""
    again = work_precision.measure(SCENE, **FLAT, steps=1e8)
    xr.testing.assert_identical(flat.isel(method=[0]), again.isel(method=[0]))
    counts = ["evaluations", "evaluations_computed"]
    xr.testing.assert_identical(flat.drop_vars(counts), again.drop_vars(counts))
    for name in counts:
        assert (abs(flat[name] - again[name]) <= 2).all()
    for name, found in (("a", flat), ("b", flat.copy(deep=True))):
        write_dataset(found, tmp_path / f"{name}.h5")
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    with xr.open_dataset(tmp_path / "a.h5", engine="h5netcdf") as stored:
        xr.testing.assert_equal(stored.load(), flat)
    for name, variable in flat.variables.items():
        assert variable.attrs["units"], name
        assert variable.attrs["long_name"], name


def test_times_are_taken_of_the_same_rungs(flat, timed):
    (found,) = tradeoff.found_in([flat.sel(stiffness=[1e2]), timed])
    done = found.data.evaluations.values > 0
    for name in ("symplectic_euler", "scipy_lsoda", "scipy_dop853"):
        place = found.methods.index(name)
        assert (found.seconds[0, place][done[0, place]] > 0).all()
    assert np.isnan(found.seconds[~done]).all()
    k = found.methods.index("symplectic_euler")
    assert 1 <= found.itself[0, k].sum() <= 3
    steps = found.data.steps.values[0, k]
    beyond = done[0, k] & ~found.itself[0, k]
    np.testing.assert_allclose(found.seconds[0, k][beyond], steps[beyond] * float(timed.seconds_per_step[0, k]))
    for peer in ("scipy_lsoda", "scipy_dop853"):
        assert found.itself[0, found.methods.index(peer)].all()
    assert {"machine_processor", "versions", "measured_at"} <= set(timed.attrs)


def test_no_step_and_no_run_of_a_peer_is_faster_than_any_processor(timed):
    names = meanings_of(timed.method)
    assert float(timed.seconds_per_step[0, names.index("symplectic_euler")]) > 1e-10
    assert float(timed.seconds[0, names.index("scipy_lsoda")][0]) > 1e-5


def test_the_tables_tell_who_is_cheapest(flat, timed):
    table = tradeoff.work_precision({"flat": flat, "timed": timed}, "A title")
    rows = [row.split("|")[1:-1] for row in table.markdown.splitlines()[4:10]]
    assert len(rows) == 2 * 3
    assert "symplectic euler" in rows[0][3]
    assert "SciPy LSODA" in rows[0][4]
    assert float(rows[0][5]) == pytest.approx(
        float(rows[0][4].split()[0].replace(",", "")) / float(rows[0][3].split()[0].replace(",", "")), rel=0.02
    )
    assert "none reaches it" in rows[5][6]  # not timed at that stiffness
    assert tradeoff.targets({"flat": flat, "timed": timed}, "A title").csv.startswith("ratio,")


def test_timings_of_nothing_are_told(timed):
    with pytest.raises(InputError, match="timings of flat-bounce: needs an experiment"):
        tradeoff.found_in([timed])


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"methods": ["golf"]}, "methods = golf: allowed is symplectic_euler or"),
        ({"problem": "golf"}, "problem = golf: allowed is flat-bounce or"),
        ({"stiffness": [0.0]}, "stiffness = 0"),
        ({"per_decade": 0}, "per_decade = 0"),
    ],
)
@pytest.mark.parametrize("function", [work_precision.measure, work_precision.time])
def test_what_cannot_be_measured_is_said(function, options, told):
    with pytest.raises(InputError, match=told):
        function(SCENE, **options)
