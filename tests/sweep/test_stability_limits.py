from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests import rounds
from tests.conftest import each

from stiffdice.io.cf_enums import meanings_of
from stiffdice.sweep import stability_limits
from stiffdice.sweep.collect import collect

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
    found = stability_limits.edges(STEPS, np.array(passes, bool))
    assert list(found) == ["first_pass", "last_fail", "steps_needed", "flips"]
    np.testing.assert_equal(list(found.values()), [first_pass, last_fail, needed, flips])


@given(st.lists(st.booleans(), min_size=1, max_size=30))
def test_edges_are_what_their_names_say(passes):
    steps = range(1, len(passes) + 1)
    passing, failing = ([step for step in steps if passes[step - 1] is wanted] for wanted in (True, False))
    settled = [step for step in steps if all(passes[step - 1 :])] if failing else []
    expected = {
        "first_pass": min(passing, default=np.nan),
        "last_fail": max(failing, default=np.nan),
        "steps_needed": min(settled, default=np.nan),  # a scan that passes from its first step on needs no more
        "flips": sum(one is not other for one, other in itertools.pairwise(passes)),
    }
    np.testing.assert_equal(stability_limits.edges(np.array(steps), np.array(passes)), expected)


@given(st.floats(-2, 2), st.floats(0.1, 1e4))
def test_a_power_law_is_found_again(exponent, factor):
    stiffness = np.geomspace(1e2, 1e7, 9)
    found = stability_limits.power_law(stiffness, factor * stiffness**exponent)
    assert found["exponent"] == pytest.approx(exponent, abs=1e-9)
    assert found["factor"] == pytest.approx(factor, rel=1e-7)
    assert found["exponent_error"] < 1e-9


def test_the_error_of_the_exponent_is_the_textbooks():
    """Against the covariance that numpy's polyfit gives."""
    rng = np.random.default_rng(0)
    stiffness = np.geomspace(1, 1e6, 20)
    steps = stiffness**0.5 * 10 ** rng.normal(0, 0.1, 20)
    (slope, _), covariance = np.polyfit(np.log10(stiffness), np.log10(steps), 1, cov=True)
    found = stability_limits.power_law(stiffness, steps)
    assert found["exponent"] == pytest.approx(slope, rel=1e-12)
    assert found["exponent_error"] == pytest.approx(np.sqrt(covariance[0, 0]), rel=1e-9)


def test_missing_points_are_left_out_and_two_are_no_law():
    stiffness = np.array([1.0, 10.0, 100.0, 1000.0])
    assert np.isnan(stability_limits.power_law(stiffness, np.array([1, np.nan, 10, np.nan]))["exponent"])
    assert stability_limits.power_law(stiffness, np.array([1, np.nan, 10, 10**1.5]))["exponent"] == pytest.approx(0.5)


@pytest.mark.parametrize("factor", [1e-3, 1.0, 50.0])
def test_the_band_is_the_textbooks(factor):
    """Against numpy polyfit's covariance, propagated to the line, and the scatter of a further point about it."""
    rng = np.random.default_rng(1)
    stiffness = np.geomspace(1e2, 1e7, 11)
    steps = factor * stiffness**0.5 * 10 ** rng.normal(0, 0.1, 11)
    fit = stability_limits.power_law(stiffness, steps)
    (slope, base), covariance = np.polyfit(np.log10(stiffness), np.log10(steps), 1, cov=True)
    at = np.geomspace(1, 1e9, 7)
    x = np.log10(at)
    of_line = covariance[0, 0] * x**2 + 2 * covariance[0, 1] * x + covariance[1, 1]
    error = np.sqrt(of_line + fit["scatter"] ** 2)
    low, high = stability_limits.band(fit, at)
    np.testing.assert_allclose(np.log10(low), slope * x + base - 2 * error, atol=1e-9)
    np.testing.assert_allclose(np.log10(high), slope * x + base + 2 * error, atol=1e-9)


@given(
    st.floats(-1, 1), st.lists(st.floats(-0.5, 0.5), min_size=3, max_size=12), st.floats(-3, 12).map(lambda x: 10.0**x)
)
def test_the_band_holds_the_line_and_is_narrowest_at_the_centre(exponent, noise, stiffness):
    grid = np.geomspace(10, 1e6, len(noise))
    fit = stability_limits.power_law(grid, 100 * grid**exponent * 10 ** np.array(noise))
    at = np.array([stiffness, fit["centre"]])
    low, high = stability_limits.band(fit, at)
    line = fit["factor"] * at ** fit["exponent"]
    assert (low <= line * (1 + 1e-12)).all()
    assert (line <= high * (1 + 1e-12)).all()
    assert np.log(high[0] / low[0]) >= np.log(high[1] / low[1]) - 1e-9


@pytest.mark.parametrize(
    ("passing", "members", "low", "high"),
    [
        # Wilson's interval at 95 %: Newcombe (1998), Statistics in Medicine 17, 857, table I, and by hand (n/(n + z²)).
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
        (32, 32, 0.8928, 1.0),
        (0, 32, 0.0, 0.1072),
    ],
)
def test_confidence_is_wilsons(passing, members, low, high):
    found = stability_limits.confidence(np.array([passing]), members)
    assert np.ravel(found) == pytest.approx([low, high], abs=6e-5)


@given(st.integers(1, 10_000).flatmap(lambda members: st.tuples(st.integers(0, members), st.just(members))))
def test_confidence_holds_the_share_and_is_the_same_for_passing_and_failing(given):
    passing, members = given
    low, high = stability_limits.confidence(np.array([passing]), members)
    assert 0 <= low <= passing / members <= high <= 1
    mirrored = stability_limits.confidence(np.array([members - passing]), members)
    np.testing.assert_allclose(mirrored, (1 - high, 1 - low), atol=1e-12)


@pytest.fixture(scope="module")
def lax(plan, shards):
    """The same runs, judged by a tolerance that lets all energies pass."""
    return collect(each(shards), {"energy": 1e6, "apex": 0.02})


@pytest.fixture(scope="module")
def found(collected):
    return stability_limits.find(collected)


UNGATED, GATED = 0, 1
ENERGY, APEX = 0, 1
LAST_FAIL = 1


def test_dimensions_are_named(found, collected, plan):
    assert found.first_pass.dims == ("contact", "criterion", "stiffness")
    assert meanings_of(found.criterion) == list(plan.criteria)
    assert found.stiffness.values.tolist() == sorted(set(collected.stiffness.values))
    for name, variable in found.variables.items():
        assert variable.attrs["units"], name
        assert variable.attrs["long_name"], name


def test_both_laws_fail_above_the_linear_limit_and_pass_far_below_it(found):
    assert (found.first_pass > found.limit).all()
    assert (found.steps_needed < 12 * found.limit).all()


@pytest.mark.long
def test_numbers_stay_finite_where_the_energy_does_not(shards):
    """Blowing up is not leaving the range of doubles: below the linear limit no run ends but by the criteria asked."""
    edges = stability_limits.find(collect(each(shards), {"finite": 0.0, "energy": 0.05}))
    finite, energy = edges.last_fail.values[:, 0], edges.last_fail.values[:, 1]
    assert (finite <= 1.2 * edges.limit.values).all()
    assert (energy > finite).all()


def test_the_gated_law_needs_more_steps(found):
    """The listings' drag in mid-air takes away what the scheme puts in."""
    needed = found.steps_needed
    assert (needed.isel(contact=GATED) > needed.isel(contact=UNGATED)).all()


def test_steps_grow_about_as_the_root_of_the_stiffness(found):
    """More steeply on soft ground, where damping hides gains; round-off alone moves it by 0.03 with these 8 members."""
    assert found.exponent.values == pytest.approx(0.5, abs=0.25)


def test_the_limit_is_where_omega_h_is_two(found):
    np.testing.assert_allclose(found.limit, 10 * np.sqrt(4 * found.stiffness) / 2, rtol=1e-12)


def test_edges_are_those_of_each_column(found, collected, plan):
    for k, s, c in [(UNGATED, 0, ENERGY), (GATED, 3, APEX), (GATED, 4, ENERGY)]:
        inside = (collected.contact.values == k) & (collected.stiffness.values == found.stiffness.values[s])
        steps, failing = collected.steps.values[inside], collected.failing.values[c, inside]
        assert found.last_fail[k, c, s] == steps[failing > 0].max()
        assert found.first_pass[k, c, s] == steps[failing == 0].min()


@pytest.mark.long
def test_a_tolerance_from_the_study_is_used_and_stored(lax):
    edges = stability_limits.find(lax)
    assert edges.tolerance.values.tolist() == [1e6, 0.02]
    assert (edges.last_fail.values[:, 0] <= 1.2 * edges.limit.values).all()  # beyond the linear limit nothing passes
    assert (edges.last_fail.values[:, 1] > edges.last_fail.values[:, 0]).all()


def test_the_scan_is_kept_with_its_edges(found, collected, plan):
    assert found.cell_steps.values.tolist() == collected.steps.values.tolist()
    passing = plan.members - collected.failing.values
    np.testing.assert_array_equal(found.pass_fraction, passing / plan.members)
    low, high = stability_limits.confidence(passing, plan.members)
    np.testing.assert_array_equal(found.pass_fraction_low, low)
    np.testing.assert_array_equal(found.pass_fraction_high, high)


def test_an_edge_at_the_end_of_its_scan_is_no_measurement(collected):
    coarse = collected.isel(cell=collected.omega_h.values > 1.0)  # as written, members fail down to the last step
    edges = stability_limits.find(coarse)
    assert np.isfinite(edges.last_fail.values[GATED, APEX]).all()
    assert np.isnan(edges.exponent.values[GATED, APEX, LAST_FAIL])


def test_each_edge_has_its_own_fit(found):
    for e, name in enumerate(stability_limits.EDGES):
        alone = stability_limits.power_law(found.stiffness.values, found[name].values[GATED, ENERGY])
        for part in stability_limits.FIT:
            np.testing.assert_equal(float(found[part][GATED, ENERGY, e]), alone[part])


def test_the_table_has_a_line_for_each_point(found):
    lines = stability_limits.table(found).splitlines()
    assert len(lines) == 1 + found.first_pass.size
    assert lines[0].startswith("contact,criterion,tolerance,stiffness_kg_s-2,limit_omega_h_2,first_pass")
    row = lines[1].split(",")
    law, criterion, tolerance, stiffness, limit, first, last, _, _, exponent, error = row
    assert float(last) == found.last_fail.values[UNGATED, ENERGY, 0]
    assert float(exponent) == pytest.approx(found.exponent.values[UNGATED, ENERGY, LAST_FAIL], abs=1e-4)
    assert float(error) == pytest.approx(found.exponent_error.values[UNGATED, ENERGY, LAST_FAIL], abs=1e-4)
    assert (law, criterion, float(tolerance), float(stiffness)) == ("ungated", "energy", 0.05, 100.0)
    assert float(limit) == 100.0
    assert float(first) == found.first_pass.values[UNGATED, ENERGY, 0]


@pytest.mark.long
def test_another_simulator_finds_the_same_edges(small, tmp_path):
    """In a first bounce: in later ones round-off grows until it decides which member passes."""
    scene, stiffness = dataclasses.replace(small.scene, duration=2.5), {"from": 1e3, "to": 1e3, "count": 1}
    few = dataclasses.replace(small, scene=scene, contact=("ungated",), stiffness=stiffness)
    found = {}
    for simulator in (few.simulator, "numpy"):
        (tmp_path / simulator).mkdir()
        paths = rounds.compute(dataclasses.replace(few, simulator=simulator), tmp_path / simulator)
        found[simulator] = stability_limits.find(collect(each(paths), few.criteria))
    ours, theirs = found.values()
    assert np.isfinite(ours.first_pass.values).all()
    for name in ("first_pass", "last_fail", "flips"):
        np.testing.assert_array_equal(theirs[name], ours[name])
