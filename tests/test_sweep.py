from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from stiffdice import sweep
from stiffdice.errors import InputError


@pytest.fixture(scope="module")
def cells(plan):
    return [cell for cell in plan.cells() if cell.stiffness == 100.0]


def test_cells_do_not_know_their_shard(plan, cells):
    """However the cells are dealt out, the collected sweep is the same."""
    whole = sweep.collect([sweep.compute(plan, cells)])
    parts = sweep.collect([sweep.compute(plan, cells[k::3]) for k in (2, 0, 1)])
    xr.testing.assert_identical(whole, parts)


def test_a_collected_sweep_is_sorted(plan, cells):
    found = sweep.collect([sweep.compute(plan, cells[::-1])])
    assert [tuple(row) for row in zip(found.contact.values, found.steps.values, strict=True)] == sorted(
        (plan.contact.index(cell.contact), cell.steps) for cell in cells
    )
    assert found.sizes == {"cell": len(cells), "member": plan.members}


def test_every_cell_says_where_it_is(plan, cells):
    found = sweep.compute(plan, cells)
    assert found.omega_h.values == pytest.approx(np.sqrt(400) * 10 / found.steps.values)
    for name, variable in found.variables.items():
        assert variable.attrs["units"], name
        assert variable.attrs["long_name"], name


def test_progress_counts_steps_not_cells(plan, cells):
    told: list[float] = []
    sweep.compute(plan, cells, told.append)
    assert told[-1] == 1.0
    assert told == pytest.approx(np.cumsum([c.steps for c in cells]) / sum(c.steps for c in cells))


def test_shards_of_different_sweeps_are_not_mixed(plan, cells):
    a, b = sweep.compute(plan, cells[:2]), sweep.compute(plan, cells[2:4])
    b.attrs["code_digest"] = "0" * 64
    with pytest.raises(InputError, match="shards differ in code_digest"):
        sweep.collect([a, b])
