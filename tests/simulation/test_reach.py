from __future__ import annotations

import dataclasses

import numpy as np
import pytest


def grown(sweep, column, passes):
    """All cells that a sweep tries in a column, of which `passes` says the share that pass."""
    scanned = sweep.scan(column)
    for rounds in range(1, sweep.refine + 1):
        passing = np.array([[passes(steps) for steps in scanned]])
        scanned = sorted([*scanned, *sweep.finer(column, scanned, passing, rounds)])
    return scanned


@pytest.fixture(scope="module")
def adaptive(plan):
    return dataclasses.replace(plan, omega_h={"from": 3.0, "to": 0.03, "count": 320}, refine=4, reach=1.2)


def test_an_adaptive_sweep_has_cells_of_its_grid_only_and_all_of_them_about_an_edge(adaptive):
    column = adaptive.columns()[0]
    whole = dataclasses.replace(adaptive, refine=0, reach=None).scan(column)
    edge = whole[150]
    cells = grown(adaptive, column, lambda steps: float(steps > edge))
    assert set(cells) < set(whole)
    assert len(cells) < 0.35 * len(whole)
    assert {steps for steps in whole if edge / 1.2 <= steps <= edge * 1.2} <= set(cells)
    assert np.diff(np.searchsorted(whole, cells)).max() == 2**adaptive.refine


def test_a_hole_within_reach_of_an_edge_is_found(adaptive):
    """A single cell fails beyond an edge; refining between disagreeing neighbours alone passes over it."""
    column = adaptive.columns()[0]
    whole = adaptive.whole_scan(column)
    hole = whole[155]
    fails = {*whole[:147], hole}
    assert hole in grown(adaptive, column, lambda steps: float(steps not in fails))
    narrow = dataclasses.replace(adaptive, reach=1.0)
    assert hole not in grown(narrow, column, lambda steps: float(steps not in fails))


def test_without_disagreement_an_adaptive_sweep_stays_coarse(adaptive):
    column = adaptive.columns()[0]
    assert grown(adaptive, column, lambda steps: 1.0) == adaptive.scan(column)
    assert len(adaptive.scan(column)) <= 320 / 16 + 1
