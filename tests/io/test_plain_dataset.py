"""A dataset without xarray is the same with it."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from stiffdice.io.plain_dataset import PlainDataset, PlainVariable
from stiffdice.io.reader import open_file, plain_file
from stiffdice.io.writer import write_dataset

UNIT = {"units": "1", "long_name": "a number"}
PLAIN = PlainDataset(
    {
        "many": PlainVariable(("row", "column"), np.arange(6.0).reshape(2, 3), UNIT),
        "one": PlainVariable((), np.asarray(4), UNIT),
    },
    {
        "row": PlainVariable(("row",), np.arange(2), UNIT),
        "label": PlainVariable(("row",), np.arange(2) + 7, UNIT),
    },
    {"title": "numbers", "format_version": "1.3"},
)


def test_xarray_takes_it_as_it_is():
    found = xr.Dataset(*PLAIN)
    assert dict(found.sizes) == PLAIN.sizes == {"row": 2, "column": 3}
    assert list(found.variables) == list(PLAIN.variables)
    more = PlainVariable(("column",), np.zeros(3), UNIT)
    xr.testing.assert_identical(xr.Dataset(*PLAIN.assign({"more": more})), found.assign(more=more))


def test_with_and_without_xarray_the_bytes_are_the_same(tmp_path):
    write_dataset(PLAIN, tmp_path / "plain.h5")
    write_dataset(xr.Dataset(*PLAIN), tmp_path / "labelled.h5")
    assert (tmp_path / "plain.h5").read_bytes() == (tmp_path / "labelled.h5").read_bytes()
    xr.testing.assert_identical(xr.Dataset(*plain_file(tmp_path / "plain.h5")), open_file(tmp_path / "labelled.h5"))


def test_coordinates_are_named_to_those_who_read_with_other_tools(tmp_path):
    """Of what has their dimensions, as CF asks; xarray then finds them."""
    write_dataset(PLAIN, tmp_path / "plain.h5")
    with xr.open_dataset(tmp_path / "plain.h5") as found:
        assert set(found.coords) == {"row", "label"}
        assert found["many"].encoding["coordinates"] == "label"
        assert "coordinates" not in found["one"].encoding


@pytest.mark.long
def test_a_run_is_stored_and_inspected_without_xarray(tmp_path):
    """Importing it takes longer than they do."""
    told = (
        "import sys; from stiffdice.cli.main import main; "
        "main(['run', 'config/scenes/figure-09.yaml', '--model', 'sliding', '-o', sys.argv[1]]); "
        "main(['inspect', sys.argv[1]]); print({'xarray', 'pandas'} & {*sys.modules})"
    )
    command = [sys.executable, "-c", told, str(tmp_path / "run.h5")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "set()"
