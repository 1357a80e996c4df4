"""Files of every version that there ever was are read, by all that reads files."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from stiffdice.io import schema
from stiffdice.io.reader import open_file
from stiffdice.io.structure_check import FORMAT_VERSION
from stiffdice.report import file_page

FORMATS = Path(__file__).parents[1] / "reference" / "formats"
FILES = sorted(FORMATS.glob("*/*.h5"))


def test_every_version_has_stored_files():
    major, minor = map(int, FORMAT_VERSION.split("."))
    assert major == 1
    assert {path.parent.name for path in FILES} == {f"1.{k}" for k in range(minor + 1)}


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_it_is_read(path):
    dataset = open_file(path)
    assert dataset.attrs["format_version"] == path.parent.name
    assert schema.problems(dataset) == []
    assert dataset.attrs["title"] in file_page.as_text(dataset, path.name)
    assert file_page.as_json(dataset)


def test_the_numbers_are_those_that_were_stored():
    with (FORMATS / "numbers.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["file"] for row in rows} == {f"{path.parent.name}/{path.name}" for path in FILES}
    datasets = {f"{path.parent.name}/{path.name}": open_file(path) for path in FILES}
    for row in rows:
        values = datasets[row["file"]][row["variable"]].values.ravel()
        assert values[int(row["index"])].item() == float(row["value"])
