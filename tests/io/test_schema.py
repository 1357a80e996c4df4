"""What is written is as the format says, and docs/reference/FORMAT.md says the same."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from stiffdice.io import schema
from stiffdice.io.reader import open_file
from stiffdice.io.structure_check import FORMAT_VERSION

STORED = Path(__file__).parents[1] / "reference" / "formats" / FORMAT_VERSION
PAGE = Path(__file__).parents[2] / "docs/reference/FORMAT.md"


@pytest.mark.parametrize("kind", ["run", "pair", "shard", "sweep", "frontier", "experiment"])
@pytest.mark.long
def test_what_is_written_is_as_the_format_says(written, kind):
    dataset = open_file(written[kind])
    assert dataset.attrs["kind"] == kind
    assert dataset.attrs["format_version"] == FORMAT_VERSION
    assert schema.problems(dataset) == []
    known = schema.KINDS[kind].attributes | schema.ATTRIBUTES
    assert {name for name, part in known.items() if part.need == schema.RECOMMENDED} <= set(dataset.attrs)


def test_the_page_is_up_to_date():
    """`make docs` writes its tables."""
    make_format = runpy.run_path(str(PAGE.parents[1] / "make_format.py"))
    assert make_format["page"](PAGE.read_text(encoding="utf-8")) == PAGE.read_text(encoding="utf-8")


def test_the_page_has_a_line_for_everything():
    sections = dict(part.split("\n", 1) for part in PAGE.read_text(encoding="utf-8").split("\n## ")[1:])
    for title, kind in {"In all files": schema.Kind(schema.ATTRIBUTES, {}), **schema.KINDS}.items():
        rows = re.findall(r"^\| `(\w+)` \|", sections[title], re.MULTILINE)
        assert rows == [*kind.attributes, *kind.variables]


@pytest.mark.parametrize("stored", [True, False], ids=["stored", "written"])
@pytest.mark.parametrize("kind", ["run", "pair", "shard", "sweep", "frontier"])
def test_names_in_files_are_those_of_the_schema(written, kind, stored):
    """Those of stored files do not change. The words of an enum are its writer's, a measure's name its criterion's."""
    dataset = open_file(STORED / f"{kind}.h5" if stored else written[kind])
    for name, part in schema.KINDS[kind].variables.items():
        if name in dataset.variables and not part.long_name.startswith("measure of criterion"):
            assert dataset[name].attrs["long_name"] == part.long_name
            assert (name in dataset.coords) == (schema.COORDINATE in part.role)
            assert ("flag_meanings" in dataset[name].attrs) == (schema.ENUM in part.role)


def test_what_came_later_is_not_demanded_of_older_files(run):
    without = run.drop_vars("ending")
    assert schema.problems(without) == ["variable ending is missing"]
    assert schema.problems(without.assign_attrs(format_version="1.2")) == []


@pytest.fixture
def run(written):
    return open_file(written["run"])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda run: run.drop_attrs(deep=False), "attribute kind = None: allowed is run or pair or shard"),
        (lambda run: run.assign_attrs(kind="walk"), "attribute kind = walk: allowed is run or pair or shard"),
        (lambda run: run.drop_vars("velocity"), "variable velocity is missing"),
        (lambda run: run.transpose(), "position has dimensions axis time: allowed is time axis"),
        (lambda run: run.assign(step=run.step.astype("i4")), "step has type i4: allowed is i8"),
        (lambda run: run.assign(position=run.position.assign_attrs(units="cm")), "position has units cm: allowed is m"),
        (lambda run: run.assign_attrs(steps=3000.0), "attribute steps = 3000.0: allowed is a whole number"),
        (lambda run: run.assign_attrs(step_size=np.nan), "attribute step_size = nan: allowed is a number"),
        (lambda run: run.assign_attrs(code_digest=7), "attribute code_digest = 7: allowed is a text"),
        (lambda run: run.assign_attrs(config="{}"), "attribute config is not that of config_digest"),
    ],
)
def test_what_is_not_as_asked_is_told(run, change, told):
    changed = change(run)
    assert any(line.startswith(told) for line in schema.problems(changed)), schema.problems(changed)


@pytest.mark.parametrize("name", [name for name, part in schema.ATTRIBUTES.items() if part.need == schema.REQUIRED])
def test_a_required_attribute_is_missed(run, name):
    del run.attrs[name]
    assert schema.problems(run)
