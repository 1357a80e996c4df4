from __future__ import annotations

import csv
import io

import numpy as np
import pytest
import xarray as xr

from stiffdice.errors import InputError
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.report.tables.sweeps import paper_questions
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.sweep.stability_limits import find

MEMBERS = 4


def frontier(stiffness, steps, failing, criterion="apex"):
    """A scan under the gated law in which so many members fail at so many steps."""
    count = len(steps)
    cells = {
        "contact": np.ones(count, np.int8),
        "stiffness": np.full(count, stiffness),
        "steps": np.array(steps),
        "omega_h": np.sqrt(4 * stiffness) * 10 / np.array(steps),
    }
    sweep = xr.Dataset(
        {
            "failing": (("criterion", "cell"), np.array([failing], np.int32)),
            "tolerance": ("criterion", [0.02]),
        },
        {name: ("cell", values, dataset.CELL_ATTRIBUTES[name]) for name, values in cells.items()}
        | {"criterion": ("criterion", np.zeros(1, np.int8), enum_attributes("criterion", [criterion]))},
        dataset.provenance_attributes("A scan", Scene(), "sliding", "symplectic_euler", "stiffdice.sweep.shard")
        | {"members": MEMBERS},
    )
    return find(sweep)


def told(sweeps):
    table = paper_questions(sweeps, "Answers")
    return {row["question"]: row["gated"] for row in csv.DictReader(io.StringIO(table.csv))}


def test_two_scans_answer_as_one():
    wide = frontier(1e6, [9_000, 15_000, 19_000, 40_000, 80_000], [4, 4, 4, 1, 0])
    fine = frontier(1e6, [9_990, 10_030, 19_900, 20_000, 20_090, 20_200, 23_050], [4, 2, 0, 0, 0, 1, 3])
    found = told({"wide": wide, "fine": fine})
    assert found["members passing near 10,000 steps (ωh = 2)"] == "25.0%"
    assert found["members passing near 20,000 steps (ωh = 1)"] == "100.0%"
    assert found["members passing near 23,000 steps (ωh = 0.87)"] == "25.0%"
    assert found["steps about 20,000 at which every member passes"] == "19,900 to 20,090"
    assert found["fewest steps at which every member passes"] == "19,900 (ωh = 1.01)"
    assert found["most steps at which a member fails"] == "40,000 (ωh = 0.5)"
    assert found["steps from which on every member passes"] == "80,000 (ωh = 0.25)"
    assert found["changes between pass and fail along the scan"] == "3"


def test_what_was_not_scanned_and_what_never_passes_is_said():
    found = told({"one": frontier(1e6, [19_000, 20_000, 21_000], [1, 2, 1])})
    assert found["members passing near 10,000 steps (ωh = 2)"] == "not scanned"
    assert found["steps about 20,000 at which every member passes"] == "none"
    assert found["fewest steps at which every member passes"] == "none"


def test_the_stiffest_ground_that_all_have_is_told():
    soft, stiff = frontier(1e4, [1000, 2000], [1, 0]), frontier(1e6, [10_000, 20_000], [1, 0])
    assert "S = 1e+06 kg/s²" in paper_questions({"a": stiff}, "A").markdown
    with pytest.raises(InputError, match="a stiffness in common"):
        paper_questions({"a": soft, "b": stiff}, "A")


def test_ends_of_a_scan_are_only_bounds():
    found = told({"one": frontier(1e6, [19_000, 20_000, 21_000], [0, 0, 0])})
    assert found["fewest steps at which every member passes"] == "19,000 or fewer"
    assert found["steps from which on every member passes"] == "19,000 or fewer"
    found = told({"one": frontier(1e6, [19_000, 20_000, 21_000], [0, 0, 1])})
    assert found["most steps at which a member fails"] == "21,000 or more"


def test_a_window_is_told_only_where_it_was_looked_for():
    found = told({"one": frontier(1e6, [2_000, 2_100], [0, 0])})
    assert found["steps about 20,000 at which every member passes"] == "not scanned"


def test_sweeps_of_another_kind_are_not_merged():
    one, other = frontier(1e6, [20_000], [0]), frontier(1e6, [20_000], [0])
    other["tolerance"] = other.tolerance + 1
    with pytest.raises(InputError, match="asks apex at another tolerance"):
        paper_questions({"one": one, "other": other}, "A")
    other = frontier(1e6, [20_000], [0])
    other.attrs["scene_digest"] = "0" * 64
    with pytest.raises(InputError, match="sweep other has another scene"):
        paper_questions({"one": one, "other": other}, "A")
