from __future__ import annotations

import copy
import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests import rounds
from tests.study.test_properties import planned, sweeps

from stiffdice.sweep import cost_model, partition
from stiffdice.sweep.grid import Column

HARDER = {"from": 1e2, "to": 1e6, "count": 9}


@pytest.fixture(scope="module")
def large(plan):
    """A sweep of more work than a handful of the shards that it asks for."""
    return dataclasses.replace(plan, stiffness={"from": 1e2, "to": 1e4, "count": 5}, seconds_per_job=0.01, members=32)


def cells_of(pieces):
    return [(column, steps) for column, scan in pieces for steps in scan]


def first_round(sweep):
    return partition.rounds(partition.of(sweep), 0)


@given(sweeps)
@pytest.mark.long
def test_every_cell_is_in_one_shard_and_in_order(asked):
    sweep = planned(asked)
    dealt = [cell for shard in first_round(sweep).values() for cell in cells_of(shard.pieces)]
    assert dealt == [(column, steps) for column in sweep.columns() for steps in sweep.scan(column)]


@given(sweeps)
@pytest.mark.long
def test_no_shard_is_longer_than_asked_by_more_than_half_and_a_cell(asked):
    sweep = planned(asked | {"seconds_per_job": 0.003})
    for shard in first_round(sweep).values():
        prices = cost_model.of(sweep, shard.pieces)
        assert shard.seconds == pytest.approx(prices.sum())
        assert prices.sum() <= 1.5 * 0.003 + prices.max()


@given(sweeps)
@pytest.mark.long
def test_no_round_has_more_shards_than_it_may_have_cells(asked):
    """However short the jobs: a million jobs of nothing would be a plan for nobody."""
    sweep = planned(asked | {"seconds_per_job": 1e-9, "refine": 2})
    counts = [len(partition.rounds(partition.of(sweep), number)) for number in range(3)]
    cells = sum(len(sweep.scan(column)) for column in sweep.columns())
    assert counts[0] <= cells
    assert counts[1] <= cells
    assert counts[2] <= 2 * cells


def test_shards_of_a_sweep_are_about_equal(large):
    seconds = [shard.seconds for shard in first_round(large).values()]
    assert len(seconds) > 10
    assert max(seconds) < 2 * np.median(seconds)
    assert min(seconds) > 0.4 * np.median(seconds)


def test_a_small_sweep_has_few_shards_and_a_large_one_more(plan):
    small, some, many = (dataclasses.replace(plan, members=members) for members in (8, 20_000, 1_000_000))
    counts = [len(first_round(sweep)) for sweep in (small, some, many)]
    work = [sum(shard.seconds for shard in first_round(sweep).values()) for sweep in (some, many)]
    assert partition.JOBS * partition.FEWEST_SECONDS < work[0] < partition.JOBS * partition.SECONDS < work[1]
    assert counts[0] == len(small.contact)
    assert partition.JOBS <= counts[1] <= partition.JOBS + len(some.contact)
    assert counts[2] == pytest.approx(work[1] / partition.SECONDS, rel=0.1)


def test_harder_grounds_that_are_added_leave_the_shards_of_the_softer_ones(large):
    before, after = first_round(large), first_round(dataclasses.replace(large, stiffness=HARDER))
    kept = before.keys() & after.keys()
    # But for the last of each law, which is filled up.
    assert len(kept) >= len(before) - len(large.contact)
    assert len(after) > len(before)


def test_a_law_that_is_added_leaves_the_others_shards(large):
    gated = dataclasses.replace(large, contact=("gated",))
    assert first_round(gated).keys() < first_round(large).keys()


def test_a_span_that_is_added_leaves_each_columns_cells(large):
    wider = dataclasses.replace(large, omega_h=[large.omega_h, {"from": 0.2, "to": 0.1, "count": 7}])
    for column in large.columns():
        scan, more = set(large.scan(column)), set(wider.scan(column))
        assert scan < more
        assert len(more - scan) == 7
        assert min(more - scan) > 0.99 * max(scan)


def test_a_further_round_leaves_the_shards_of_those_before(large):
    once, thrice = (partition.of(dataclasses.replace(large, refine=count)) for count in (1, 3))
    assert once.keys() < thrice.keys()
    work = [sum(shard.seconds for shard in partition.rounds(thrice, number).values()) for number in range(4)]
    assert work == pytest.approx([work[0] * part for part in (1, 0.5, 1, 2)])  # each later round twice the one before


@given(st.integers(1, 3), st.integers(1, 12))
def test_later_rounds_share_out_their_cells(number, parts):
    sweep = planned(
        {
            "model": "sliding",
            "contact": ["gated", "ungated"],
            "stiffness": {"from": 1e2, "to": 1e4, "count": 4},
            "omega_h": {"from": 2.0, "to": 0.5, "count": 9},
            "members": 2,
        }
    )
    pieces = [partition.Piece(column, tuple(sweep.scan(column)[:number])) for column in sweep.columns()[::number]]
    dealt = partition.share(sweep, pieces, parts)
    assert len(dealt) == parts
    assert [cell for part in dealt for cell in cells_of(part)] == cells_of(pieces)
    costs = iter(cost_model.of(sweep, pieces).tolist())
    prices = [sum(next(costs) for _ in cells_of(part)) for part in dealt]
    dearest = cost_model.of(sweep, pieces).max()
    # Where a part ends is missed by half a cell at most.
    asked = sum(prices) * np.arange(1, parts + 1) / parts
    assert np.abs(np.cumsum(prices) - asked).max() <= dearest / 2 * (1 + 1e-9)


def test_a_round_without_cells_has_empty_shards(plan):
    assert partition.share(plan, [], 3) == [(), (), ()]


@pytest.mark.long
def test_rounds_go_where_members_disagree(small, tmp_path):
    sweep = dataclasses.replace(small, refine=2, omega_h={"from": 2.5, "to": 0.3, "count": 10})
    found = rounds.judged(sweep, rounds.compute(sweep, tmp_path))
    first = {cell for piece in partition.scan(sweep) for cell in cells_of([piece])}
    shares = 1 - found.failing.values / sweep.members
    later = 0
    for column in sweep.columns():
        here = (found.stiffness.values == column.stiffness) & (
            found.contact.values == sweep.contact.index(column.contact)
        )
        steps = found.steps.values[here].tolist()
        for k, count in enumerate(steps):
            if (column, count) in first:
                continue
            later += 1
            around = shares[:, here][:, max(0, k - 2) : k + 3]
            assert ((around > 0) & (around < 1)).any() or (np.ptp(around, axis=1) > 0).any()
    assert later > 5


def test_an_id_is_of_what_a_shard_holds_not_of_how_long_its_job_takes(plan):
    whole = first_round(dataclasses.replace(plan, seconds_per_job=1e6))
    assert first_round(dataclasses.replace(plan, seconds_per_job=2e6)) == whole
    assert first_round(copy.deepcopy(plan)).keys() == first_round(plan).keys()


def test_a_column_may_be_cut(plan):
    one = dataclasses.replace(plan, contact=("gated",), stiffness={"from": 1e4, "to": 1e4, "count": 1})
    parts = first_round(rounds.in_parts(one, 4)).values()
    assert len(parts) == 4
    assert {piece.column for shard in parts for piece in shard.pieces} == {Column("gated", 1e4)}


def test_a_plan_is_made_once(plan):
    """Of 10⁵ stiffnesses it takes seconds, and the workflow asks for it again and again."""
    assert partition.of(plan) is partition.of(plan)
