"""Enums of a file as words, to select by."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import stiffdice
from stiffdice.errors import InputError

FORMATS = Path(__file__).parents[1] / "reference" / "formats"


@pytest.mark.parametrize(
    ("name", "selection", "number"),
    [
        ("run", {"axis": "z"}, 2),
        ("frontier", {"contact": "gated"}, 1),
        ("frontier", {"criterion": "apex", "edge": "last_fail"}, (1, 1)),
        ("sweep", {"contact": "gated"}, 1),
        ("sweep", {"verdict": "passed"}, 0),
        ("shard", {"contact": "ungated"}, 0),
    ],
)
@pytest.mark.long
def test_a_word_selects_what_its_number_does(name, selection, number):
    path = FORMATS / "1.2" / f"{name}.h5"
    found = stiffdice.open_results(path).sel(selection)
    with xr.open_dataset(path) as stored:
        numbers = stored
        for (key, word), value in zip(selection.items(), np.atleast_1d(number), strict=True):
            assert numbers[key].attrs["flag_meanings"].split()[value] == word
            (dimension,) = numbers[key].dims
            numbers = numbers.isel({dimension: np.flatnonzero(numbers[key].values == value)}).squeeze()
    for variable in numbers.data_vars:
        if "flag_meanings" not in numbers[variable].attrs:
            np.testing.assert_array_equal(found[variable].values, numbers[variable].values)


@pytest.mark.long
def test_a_verdict_is_a_word_whatever_its_shape():
    run, shard = (stiffdice.open_results(FORMATS / "1.2" / f"{name}.h5") for name in ("run", "shard"))
    assert run.verdict.item() in ("passed", "energy_grew", "apex_rose")
    assert set(np.unique(shard.verdict)) <= {"passed", "energy_grew", "apex_rose"}
    assert run.verdict.attrs == {"long_name": "verdict", "units": "1"}


def test_what_is_no_enum_is_as_stored():
    path = FORMATS / "1.2" / "run.h5"
    with xr.open_dataset(path) as stored:
        found = stiffdice.open_results(path)
        for name in ("time", "position", "energy_ratio", "node"):
            xr.testing.assert_identical(
                found[name].drop_vars("axis", errors="ignore"), stored[name].drop_vars("axis", errors="ignore")
            )
        assert found.attrs.keys() == stored.attrs.keys()


def test_a_file_that_cannot_be_trusted_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.h5: No such file"):
        stiffdice.open_results(tmp_path / "nowhere.h5")
