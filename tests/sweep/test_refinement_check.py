from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.report.tables.sweeps import refinement_check as table
from stiffdice.sweep import refinement_check, stability_limits
from stiffdice.sweep.refinement_check import BINS, Scan
from stiffdice.sweep.stability_limits import edges

MEMBERS = 32


def scanned(seed, chance, count=400):
    """A jittered scan of 32 members from 100 to 10⁴ steps, each of which passes with a chance that steps decide."""
    generator = np.random.default_rng(seed)
    places = np.log(100.0) * (1 + (np.arange(count) + generator.random(count)) / count)
    passing = generator.binomial(MEMBERS, chance(places - np.log(1000)))
    return Scan(np.round(np.exp(places)).astype(np.int64), passing / MEMBERS)


def slope(places):
    return 1 / (1 + np.exp(-8 * places))


def ragged(share, teeth=False):
    """A ground on which such a share of cells has members that fail, up to an edge; none at the teeth of a comb."""
    rate = 1 - (1 - share) ** (1 / MEMBERS)

    def chance(places):
        failing = np.where(places > 0, 0.0, rate)
        return 1 - np.where(teeth & (np.sin(60 * places) > 0.6), 0.0, failing)

    return chance


@pytest.mark.parametrize("edge", ["last_fail", "steps_needed"])
@pytest.mark.parametrize(("share", "teeth"), [(0.99, False), (0.5, False), (0.25, False), (0.9, True)])
def test_scans_with_another_jitter_find_an_edge_in_the_band(share, teeth, edge):
    scans = [scanned(seed, ragged(share, teeth)) for seed in range(60)]
    found = np.array([edges(scan.steps, scan.shares == 1)[edge] for scan in scans])
    bands = [refinement_check.band(scan, edge) for scan in scans]
    inside = [np.delete((limits.low <= found) & (found <= limits.high), k) for k, limits in enumerate(bands)]
    assert np.mean(inside) >= 0.85  # 0.95 if the share were known; five gaps tell it to within a half
    # Not much wider than the scatter it stands for, but that an edge is told to two cells at best.
    cell = np.log(100) / 400
    assert np.median([limits.error for limits in bands]) <= 1.5 * np.log(found).std() + 2 * cell


def test_a_first_pass_is_a_last_fail_seen_from_above():
    scan = scanned(1, ragged(0.3))
    turned = Scan(np.round(1e9 / scan.steps[::-1]).astype(np.int64), np.where(scan.shares[::-1] < 1, 1.0, 0.0))
    above, below = refinement_check.band(turned, "first_pass"), refinement_check.band(scan, "last_fail")
    assert below.low * above.high == pytest.approx(1e9, rel=1e-3)
    assert above.error == pytest.approx(below.error, rel=1e-3)


def test_an_edge_that_is_not_there_has_no_band():
    everywhere = Scan(np.arange(10, 20), np.ones(10))
    assert np.isnan(refinement_check.band(everywhere, "last_fail")).all()
    limits = refinement_check.band(everywhere, "first_pass")
    assert limits.low < 10 < limits.high


def test_crowded_cells_do_not_pull_a_mean():
    """A grid that is four times as dense where a third passes has the mean of an even one."""
    even = np.geomspace(100, 10_000, 401)
    crowded = np.concatenate([even[:200:4], even[200:]])
    means = []
    for steps in (even, crowded):
        scan = Scan(np.round(1000 * steps).astype(np.int64), np.where(steps < 1000, 1.0, 1 / 3))
        means.append(refinement_check.binned(scan, np.log(1000 * np.array([100.0, 10_000.0])))[0])
    np.testing.assert_allclose(means, 2 / 3, atol=0.005)


def test_the_error_of_a_mean_is_its_scatter_over_jitters():
    ends = np.log(1000) + np.linspace(-0.3, 0.3, 4)
    told = [refinement_check.binned(scanned(seed, slope), ends) for seed in range(200)]
    means, errors = (np.array(part) for part in zip(*told, strict=True))
    np.testing.assert_allclose(np.sqrt((errors**2).mean(axis=0)), means.std(axis=0), rtol=0.2)


def rows_of(sweeps):
    shown = table(sweeps, "A title")
    assert shown.markdown.startswith("# A title\n")
    return list(csv.DictReader(io.StringIO(shown.csv)))


def thinned(collected, keep):
    return stability_limits.find(collected.isel(cell=keep))


def test_a_grid_beside_itself_is_the_same(collected):
    dense = stability_limits.find(collected)
    rows = rows_of({"dense": dense, "again": dense})
    assert {row["what"] for row in rows} == {*stability_limits.EDGES, "pass fraction"}
    assert all(row["equal"] == row["compared"] for row in rows)
    assert all(row["largest"] in ("", "0.00%") for row in rows)
    assert all(row["apart in standard errors"] in ("", "0.0") for row in rows)
    assert all(row["of the dense grid's"] == row["of its steps"] == "100.0%" for row in rows)
    told = {(row["contact law"], row["criterion"]): int(row["compared"]) for row in rows if row["what"] == "last_fail"}
    assert told["gated", "apex"] == told["gated", "energy"] == dense.sizes["stiffness"]


def test_a_grid_that_leaves_the_last_failing_cells_out_is_found_out(collected):
    """All is cleared of failing cells beyond half of the steps of the true last fail."""
    dense = stability_limits.find(collected)
    last = dense.last_fail.max("criterion")
    law, stiffness = collected.contact.values, collected.stiffness.values
    columns = [dense.stiffness.values.tolist().index(value) for value in stiffness]
    fails = (collected.failing.values > 0).any(axis=0)
    hidden = fails & (collected.steps.values > 0.5 * last.values[law, columns])
    rows = rows_of({"dense": dense, "coarse": thinned(collected, ~hidden)})
    told = {(row["contact law"], row["criterion"], row["what"]): row for row in rows}
    apex = told["gated", "apex", "last_fail"]
    assert float(apex["within the 95 % band"].rstrip("%")) < 50
    assert float(apex["largest"].rstrip("%")) >= 50
    assert int(apex["runs"].replace(",", "")) == 8 * int((~hidden & (law == 1)).sum())


def test_a_narrow_hole_is_seen_in_the_bins():
    """One part in BINS of a scan fails altogether, and the other scan passed over it."""
    steps = np.round(np.geomspace(1e4, 1e6, 10 * BINS)).astype(np.int64)
    shares = np.ones(len(steps))
    shares[100:110] = 0
    ends = refinement_check.bins(Scan(steps, shares), Scan(steps, np.ones(len(steps))))
    mean, error = refinement_check.binned(Scan(steps, shares), ends)
    assert ((1 - mean) > refinement_check.WIDTH * error).sum() >= 1


def test_bins_span_what_all_scans_have():
    one, other = (Scan(np.array(steps), np.ones(3)) for steps in ([10, 50, 800], [20, 50, 1000]))
    ends = np.exp(refinement_check.bins(one, other))
    assert len(ends) == BINS + 1
    assert ends[[0, -1]] == pytest.approx([20, 800])


def test_a_cell_counts_for_the_steps_nearest_to_it():
    """Of three cells at 1, 2 and 4 in the logarithm the steps from 0 to 6 are 1.5, 1.5 and 3."""
    scan = Scan(np.exp([1.0, 2.0, 4.0]), np.array([1.0, 0.0, 0.5]))
    mean, error = refinement_check.binned(scan, np.array([0.0, 6.0]))
    assert mean == pytest.approx([(1.5 * 1 + 1.5 * 0 + 3 * 0.5) / 6])
    away = (
        np.array([1 - 0, 0 - (1 + 0.5) / 2, 0.5 - 0]) ** 2 * 2 / 3
    )  # beyond an end lies the cell next to it, mirrored
    assert error == pytest.approx([np.sqrt(np.sum((np.array([1.5, 1.5, 3]) / 6) ** 2 * away))])


@pytest.mark.parametrize("problem", ["alone", "members", "tolerance", "stiffness", "span of steps"])
def test_what_cannot_be_compared_is_refused(collected, problem):
    dense = stability_limits.find(collected)
    other = dense.copy()
    if problem == "members":
        other = other.assign_attrs(members=9)
    elif problem == "tolerance":
        other["tolerance"] = other.tolerance + 1
    elif problem == "stiffness":
        other = other.assign_coords(cell_stiffness=2 * other.cell_stiffness)
    elif problem == "span of steps":
        other = other.assign_coords(cell_steps=100 * other.cell_steps)
    sweeps = {"dense": dense} if problem == "alone" else {"dense": dense, "other": other}
    with pytest.raises(InputError, match={"alone": "one or more"}.get(problem, problem)):
        table(sweeps, "A title")
