"""Our files keep the CF conventions, by the checker of the IOOS; findings that we mean so: docs/reference/FORMAT.md."""

from __future__ import annotations

import shutil
import warnings

import pytest

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from compliance_checker.runner import CheckSuite

# Findings that are meant so: section → what it says.
MEANT = {
    "§5.1 Independent Latitude, Longitude, Vertical, and Time Axes": "Coordinate variable 'time' should have "
    "standard_name='time', found: 'None'",  # time since the launch has no calendar, which that name demands
}


@pytest.fixture(scope="module")
def suite():
    suite = CheckSuite()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        suite.load_all_available_checkers()
    return suite


@pytest.mark.parametrize("kind", ["run", "pair", "shard", "sweep", "frontier", "experiment"])
@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_files_keep_the_cf_conventions(written, tmp_path, suite, kind):
    # CF wants names that end in .nc; ours end in .h5, as those who read HDF5 expect.
    path = shutil.copy(written[kind], tmp_path / f"{kind}.nc")
    groups, errors = suite.run_all(suite.load_dataset(str(path)), ["cf:1.11"], [])["cf:1.11"]
    assert errors == {}
    assert len(groups) > 20
    found = {group.name: set(group.msgs) for group in groups if group.value[0] != group.value[1]}
    assert found == {name: {text} for name, text in MEANT.items() if kind in ("run", "pair")}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_the_checker_sees_what_is_wrong(written, tmp_path, suite):
    import netCDF4

    path = shutil.copy(written["sweep"], tmp_path / "sweep.nc")
    with netCDF4.Dataset(path, "a") as file:
        file["stiffness"].units = "stones"
    groups, _ = suite.run_all(suite.load_dataset(str(path)), ["cf:1.11"], [])["cf:1.11"]
    assert any("stones" in message for group in groups for message in group.msgs)
