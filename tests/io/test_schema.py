"""What is written is as the format says, and docs/FORMAT.md says the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stiffdice.io import schema
from stiffdice.io.attribute_check import FORMAT_VERSION
from stiffdice.io.reader import open_file

PAGE = (Path(__file__).parents[2] / "docs" / "FORMAT.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", ["run", "shard", "sweep", "frontier", "experiment"])
def test_what_is_written_is_as_the_format_says(written, kind):
    dataset = open_file(written[kind])
    assert dataset.attrs["kind"] == kind
    assert dataset.attrs["format_version"] == FORMAT_VERSION
    assert schema.problems(dataset) == []
    known = schema.KINDS[kind].attributes | schema.ATTRIBUTES
    assert {name for name, part in known.items() if part.need == schema.RECOMMENDED} <= set(dataset.attrs)


def test_the_page_has_a_line_for_everything():
    for name, attribute in schema.ATTRIBUTES.items():
        assert f"| `{name}` | {attribute.type} | {attribute.need} | " in PAGE
    for kind, told in schema.KINDS.items():
        section = PAGE.split(f"## {kind}\n")[1].split("\n## ")[0]
        rows = [line for line in section.splitlines() if line.startswith("| `")]
        asked = [f"| `{name}` | {part.type} | {part.need} | " for name, part in told.attributes.items()]
        for name, part in told.variables.items():
            dimensions = ", ".join(part.dimensions) or "none"
            asked.append(f"| `{name}` | {dimensions} | {part.type} | {part.units} | {part.need} | ")
        assert len(rows) == len(asked)
        for row, start in zip(rows, asked, strict=True):
            assert row.startswith(start)


@pytest.fixture
def run(written):
    return open_file(written["run"])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda run: run.drop_attrs(deep=False), "attribute kind = None: allowed is run or shard"),
        (lambda run: run.assign_attrs(kind="walk"), "attribute kind = walk: allowed is run or shard"),
        (lambda run: run.drop_vars("velocity"), "variable velocity is missing"),
        (lambda run: run.transpose(), "position has dimensions (axis, time): allowed are (time, axis)"),
        (lambda run: run.assign(step=run.step.astype("i4")), "step is of type i4: allowed is i8"),
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
