from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from stiffdice.experiments.measuring import coordinates
from stiffdice.experiments.work_precision.measure import GRID
from stiffdice.report.tables.methods import cost_of, engines_note, found_in, targets, work_precision

COSTS = np.array([1e2, 1e3, 1e4, 1e5, 1e6])


def cost(errors, bound=1e-3, continued=True, costs=COSTS):
    return cost_of(np.array(errors, float), costs, bound, continued=continued)


def test_between_rungs_a_power_law_is_met_exactly():
    found = cost(5 / COSTS**0.8, 1e-3)
    assert found.value == pytest.approx(5000**1.25)
    assert found.reached
    assert found.tried == 1e6


def test_what_comes_and_goes_counts_from_where_it_stays():
    assert cost([1e-1, 1e-4, 1e-2, 1e-4, 1e-5]).value == pytest.approx(10**4.5)
    assert cost([1e-1, 1e-4, np.nan, 1e-4, 1e-5]).value == 1e5
    assert cost([1e-1, 1e-2, np.inf, 0.0, 1e-5]).value == 1e5
    assert cost([1e-1, 1e-2, 1e-2, 0.0, 1e-5]).value == 1e5


def test_the_first_rung_may_do():
    assert cost([1e-4, 1e-5, 1e-6, 1e-7, 1e-8]) == (1e2, True, 1e6)


@pytest.mark.parametrize("order", [0.7, 1.0, 2.0])
def test_a_ladder_that_ends_before_is_continued_by_its_power_law(order):
    errors = 0.1 * (COSTS / 1e3) ** -order
    found = cost(errors, errors[-1] / 10)
    assert found.value == pytest.approx(1e6 * 10 ** (1 / order))
    assert not found.reached


@pytest.mark.parametrize(
    ("errors", "why"),
    [
        ([1e-1, 1e-1, 1e-1, 1e-1, 1e-1], "it does not fall"),
        ([5e-1, 5e-1, 5e-1, 1e-2, 5e-3], "it hardly fell"),
        ([1e-1, 1e-2, 1e-3, 1e-4, np.nan], "its last run failed"),
        ([1e3, 1e2, 1e1, 1e0, 1e-1], "it had nothing to do with the reference for long"),
        ([1e-1, 8e-2, 6e-2, 4e-2, 2e-2], "too far"),
    ],
)
def test_what_shows_no_law_is_not_continued(errors, why):
    found = cost(errors, 1e-9)
    assert np.isnan(found.value), why
    assert not found.reached
    assert found.tried == 1e6


def test_a_method_that_ended_by_itself_is_not_continued():
    assert np.isnan(cost(1 / COSTS, 1e-8, continued=False).value)


def test_rungs_without_a_cost_are_left_out():
    costs = np.array([1e2, np.nan, 1e4, 0.0, np.inf])
    found = cost([1e-2, 1e-9, 1e-4, 1e-9, 1e-9], costs=costs)
    assert found == (pytest.approx(1e3), True, 1e4)
    assert np.isnan(cost([1.0], costs=np.array([np.nan]))).any()


def made(problem, methods, tolerance, errors, evaluations, seconds):
    """An experiment and its timing, arrays (stiffness, method, effort); one ladder of tolerances for all."""
    shape = np.shape(errors)
    grounds = list(np.geomspace(1e2, 1e12, shape[0]))
    tried = {
        "steps": (GRID, np.full(shape, 12)),
        "tolerance": (GRID, np.broadcast_to(tolerance, shape)),
    }
    axes = coordinates(stiffness=grounds, method=methods)
    found = {"evaluations": evaluations, "position_error": errors}
    variables = {name: (GRID, np.array(values, float)) for name, values in found.items()}
    times = {
        "seconds": (GRID, np.array(seconds, float)),
        "seconds_per_step": (GRID[:2], np.full(shape[:2], np.nan)),
    }
    attributes = {"problem": problem}
    return {
        "found": xr.Dataset(tried | variables, axes, attributes),
        "timed": xr.Dataset(tried | times, axes, attributes),
    }


THROW = made(
    "tumbling-throw",
    ["event", "scipy_lsoda"],
    [1e-3, 1e-6],
    [[[1e-4, 1e-8], [1e-4, 1e-8]], [[1e-4, 1e-8], [1e-4, 1e-8]]],
    [[[100, 10_000], [400, 40_000]], [[120, 12_000], [800, 80_000]]],
    [[[1e-6, 1e-4], [1e-4, 1e-2]], [[1.5e-6, 1.5e-4], [3e-4, 3e-2]]],
)


def test_targets_are_ratios_at_equal_error():
    """Half-way down the ladder in the logarithm, where 1e-6 is, costs are the geometric means."""
    rows = [row.split(",") for row in targets(THROW, "A title").csv.splitlines()[1:]]
    assert [row[-2:] for row in rows] == [["", "1.2"], ["4", "6.67"], ["", "1.5"], ["100", "200"]]


def test_the_table_has_the_cheapest_scheme_and_scipys_best_beside():
    lines = work_precision(THROW, "A title").markdown.splitlines()
    (row,) = (line for line in lines if line.startswith("| tumbling throw | 100 | 1e-06 |"))
    cells = [cell.strip() for cell in row.split("|")[4:-1]]
    assert cells == ["1,000 (event)", "4,000 (SciPy LSODA)", "4", "10 µs (event)", "1 ms (SciPy LSODA)", "100"]


def test_where_nobody_timed_nothing_is_told_of_time():
    alone = {"found": THROW["found"]}
    assert found_in(alone.values())[0].seconds is None
    assert "µs" not in work_precision(alone, "A title").markdown
    assert len(targets(alone, "A title").csv.splitlines()) == 3


def compared(*methods, versions=""):
    words = {"flag_values": np.arange(len(methods)), "flag_meanings": " ".join(methods)}
    return xr.Dataset({"method": ("method", np.arange(len(methods)), words)}, attrs={"engine_versions": versions})


def test_schemes_and_solvers_alone_need_no_word_on_engines():
    assert engines_note([compared("event", "scipy_lsoda")]) == ""


def test_a_solver_of_scipy_stands_for_scipy():
    note = engines_note([compared("mujoco", "scipy_dop853", versions="MuJoCo 4.0.0; SciPy 1.17.1")])
    assert note.startswith("Engines: MuJoCo 4.0.0, SciPy 1.17.1. Left out or not installed: PyBullet, Drake, DART,")
    assert "SciPy LSODA" not in note
