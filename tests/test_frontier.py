from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiffdice import frontier, sweep

STEPS = np.array([10, 20, 30, 40, 50])


@pytest.mark.parametrize(
    ("passes", "first_pass", "last_fail", "needed", "flips"),
    [
        ([0, 0, 1, 1, 1], 30, 20, 30, 1),
        ([0, 1, 0, 1, 1], 20, 30, 40, 3),
        ([1, 1, 1, 1, 1], 10, np.nan, np.nan, 0),
        ([0, 0, 0, 0, 0], np.nan, 50, np.nan, 0),
        ([0, 1, 1, 1, 0], 20, 50, np.nan, 2),
    ],
)
def test_edges_of_a_scan(passes, first_pass, last_fail, needed, flips):
    found = frontier.edges(STEPS, np.array(passes, bool))
    assert list(found) == ["first_pass", "last_fail", "steps_needed", "flips"]
    np.testing.assert_equal(list(found.values()), [first_pass, last_fail, needed, flips])


@given(st.lists(st.booleans(), min_size=1, max_size=30))
def test_edges_are_what_their_names_say(passes):
    steps = np.arange(1, len(passes) + 1)
    found = frontier.edges(steps, np.array(passes))
    if np.isfinite(found["steps_needed"]):
        assert all(passes[int(found["steps_needed"]) - 1 :])
        assert found["steps_needed"] > found["last_fail"]
    if np.isfinite(found["first_pass"]):
        assert not any(passes[: int(found["first_pass"]) - 1])
    monotone = found["flips"] <= 1 and passes[-1]
    if monotone and np.isfinite(found["steps_needed"]):
        assert found["first_pass"] == found["steps_needed"]


@given(st.floats(-2, 2), st.floats(0.1, 1e4))
def test_a_power_law_is_found_again(exponent, factor):
    stiffness = np.geomspace(1e2, 1e7, 9)
    found = frontier.power_law(stiffness, factor * stiffness**exponent)
    assert found["exponent"] == pytest.approx(exponent, abs=1e-9)
    assert found["factor"] == pytest.approx(factor, rel=1e-7)
    assert found["exponent_error"] < 1e-9


def test_the_error_of_the_exponent_is_the_textbooks():
    """Against the covariance that numpy's polyfit gives."""
    rng = np.random.default_rng(0)
    stiffness = np.geomspace(1, 1e6, 20)
    steps = stiffness**0.5 * 10 ** rng.normal(0, 0.1, 20)
    (slope, _), covariance = np.polyfit(np.log10(stiffness), np.log10(steps), 1, cov=True)
    found = frontier.power_law(stiffness, steps)
    assert found["exponent"] == pytest.approx(slope, rel=1e-12)
    assert found["exponent_error"] == pytest.approx(np.sqrt(covariance[0, 0]), rel=1e-9)


def test_missing_points_are_left_out_and_two_are_no_law():
    stiffness = np.array([1.0, 10.0, 100.0, 1000.0])
    assert np.isnan(frontier.power_law(stiffness, np.array([1, np.nan, 10, np.nan]))["exponent"])
    assert frontier.power_law(stiffness, np.array([1, np.nan, 10, 10**1.5]))["exponent"] == pytest.approx(0.5)


@pytest.fixture(scope="module")
def found(plan):
    collected = sweep.collect([sweep.compute(plan, cells) for cells in plan.shards().values()])
    return frontier.find(collected, {}), frontier.find(collected, {"energy": 1e6}), collected


def test_both_laws_fail_above_the_linear_limit_and_pass_far_below_it(found):
    edges = found[0]
    assert (edges.first_pass > edges.limit).all()
    assert (edges.steps_needed < 12 * edges.limit).all()


def test_the_gated_law_needs_more_steps(found):
    """The listings' drag in mid-air takes away what the scheme puts in."""
    needed = found[0].steps_needed
    assert (needed.isel(contact=1) > needed.isel(contact=0)).all()


def test_steps_grow_about_as_the_root_of_the_stiffness(found):
    assert found[0].exponent.values == pytest.approx(0.5, abs=0.17)


def test_a_tolerance_from_the_study_is_used_and_stored(found):
    _, lax, _ = found
    assert lax.tolerance.values[0] == 1e6
    assert np.isnan(lax.last_fail.values[:, 0]).all()


def test_a_run_that_left_the_numeric_range_fails_every_criterion(found):
    collected = found[2].copy(deep=True)
    collected["verdict"][:] = 5
    assert np.isnan(frontier.find(collected, {}).first_pass).all()


def test_the_scan_is_kept_with_its_edges(found):
    edges, lax, collected = found
    assert edges.cell_steps.values.tolist() == collected.steps.values.tolist()
    failing = (collected.energy_ratio > 1.05).mean("member").values
    np.testing.assert_allclose(edges.failing.values[0], failing, atol=1e-12)
    assert not lax.failing.values[0].any()


def test_an_edge_at_the_end_of_its_scan_is_no_measurement(found):
    collected = found[2]
    coarse = collected.isel(cell=collected.omega_h.values > 1.0)  # as written, members fail down to the last step
    edges = frontier.find(coarse, {})
    apex, last_fail = 1, 1
    assert np.isfinite(edges.last_fail.values[1, apex]).all()
    assert np.isnan(edges.exponent.values[1, apex, last_fail])


def test_each_edge_has_its_own_fit(found):
    edges = found[0]
    for e, name in enumerate(frontier.EDGES):
        alone = frontier.power_law(edges.stiffness.values, edges[name].values[1, 0])
        assert edges.exponent.values[1, 0, e] == alone["exponent"]


def test_the_table_has_a_line_for_each_point(found):
    edges = found[0]
    lines = frontier.table(edges).splitlines()
    assert len(lines) == 1 + edges.first_pass.size
    assert lines[0].startswith("contact,criterion,tolerance,stiffness_kg_s-2,limit_omega_h_2,first_pass")
    law, criterion, tolerance, stiffness, limit, first, last, _, _, exponent, error = lines[1].split(",")
    assert float(last) == edges.last_fail.values[0, 0, 0]
    assert float(exponent) == pytest.approx(edges.exponent.values[0, 0, 1], abs=1e-4)
    assert float(error) == pytest.approx(edges.exponent_error.values[0, 0, 1], abs=1e-4)
    assert (law, criterion, float(tolerance), float(stiffness)) == ("ungated", "energy", 0.05, 100.0)
    assert float(limit) == 100.0
    assert float(first) == edges.first_pass.values[0, 0, 0]
