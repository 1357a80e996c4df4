from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from tests.conftest import ROOT, each
from tests.sweep.test_shard import DEFAULTS, collected, computed, small

from stiffdice.errors import InputError
from stiffdice.io.cf_enums import meanings_of
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.criteria import registry as criteria
from stiffdice.simulation.outcome import Verdict
from stiffdice.sweep.collect import collect
from stiffdice.sweep.grid import Column


def test_a_collected_sweep_is_sorted(tmp_path):
    planned = small()
    found = collected(planned, tmp_path, columns=planned.columns()[::-1])
    rows = list(zip(found.contact.values, found.stiffness.values, found.steps.values, strict=True))
    assert rows == sorted(
        (planned.contact.index(column.contact), column.stiffness, steps)
        for column in planned.columns()
        for steps in planned.scan(column)
    )


def test_a_collected_cell_is_what_its_members_add_up_to(tmp_path):
    planned = small()
    runs = computed(planned, tmp_path)
    found = collect([runs], planned.criteria)
    where = np.lexsort([runs[key].values for key in ("steps", "stiffness", "contact")])
    runs = runs.isel(cell=where)
    assert meanings_of(found.criterion) == list(planned.criteria)
    assert found.tolerance.values.tolist() == list(planned.criteria.values())
    for c, (name, tolerance) in enumerate(planned.criteria.items()):
        part = criteria.CRITERIA[name]
        fails = (runs[part.MEASURE].values > part.BASE + tolerance) | (runs.ending.values != Verdict.PASSED)
        np.testing.assert_array_equal(found.failing[c], fails.sum(axis=1))
        np.testing.assert_array_equal(found[f"largest_{part.MEASURE}"], runs[part.MEASURE].max("member"))
    for verdict in Verdict:
        np.testing.assert_array_equal(found.verdicts[:, verdict], (runs.verdict == verdict).sum("member"))
    np.testing.assert_array_equal(found.steps_computed, runs.steps_computed.sum("member"))
    assert found.attrs["members"] == planned.members


def test_other_tolerances_judge_the_same_runs(tmp_path):
    runs = computed(small(), tmp_path)
    strict, lax = (collect([runs], {"energy": tolerance}) for tolerance in (0.01, 1e6))
    ended_badly = (runs.ending != Verdict.PASSED).sum()
    assert strict.failing.sum() > lax.failing.sum() == ended_badly > 0


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"members": 9}, "members, config, config_digest"),
        ({"early_stop": True}, "early_stop, criteria, config, config_digest"),
        ({"criteria": DEFAULTS | {"trajectory": 1.0}, "horizon": 1.0}, "horizon, horizon_units, config, config_digest"),
        ({"scene": from_mapping({"cube": {"mass": 2}})}, "scene, scene_digest"),
    ],
)
@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.long
def test_shards_of_different_sweeps_are_not_mixed(tmp_path, change, told, order):
    cheap = {"omega_h": {"from": 3.0, "to": 2.0, "count": 2}}
    shards = [
        computed(small(**cheap, **options), tmp_path, [column])
        for options, column in (({}, Column("gated", 1e2)), (change, Column("gated", 1e3)))
    ]
    with pytest.raises(InputError) as caught:
        collect(shards[::order], DEFAULTS)
    assert set(told.split(", ")) == set(
        str(caught.value).removeprefix("shards differ in ").removesuffix("; they are not of one sweep").split(", ")
    )


def test_shards_of_different_code_are_not_mixed(shards, plan):
    with_another = [*each(shards[:1]), *each(shards[:1])]
    with_another[1] = with_another[1].assign_attrs(code_digest="0" * 64)
    with pytest.raises(InputError, match="shards differ in code_digest"):
        collect(with_another, plan.criteria)


COLLECTED = """
import resource, sys
import numpy as np
from stiffdice.sweep.collect import collect
from stiffdice.io.reader import open_file
shard = open_file(sys.argv[1])
part = shard.isel(cell=np.resize(np.arange(shard.sizes["cell"]), 1000))
for times in (2, 100):
    collect((part.copy(deep=True) for _ in range(times)), {"energy": 0.05, "apex": 0.05})
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)  # kB, so far
"""


@pytest.mark.long
def test_what_is_collected_leaves_its_runs_behind(tmp_path):
    """A hundred thousand cells of 32 members: their measures alone would be 100 MB, all of their runs 400 MB."""
    computed(small(members=32), tmp_path)
    (shard,) = tmp_path.glob("*.h5")
    command = [sys.executable, "-c", COLLECTED, str(shard)]
    few, many = map(int, subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split())
    assert many - few < 40_000
