from __future__ import annotations

from pathlib import Path

import pytest

from stiffdice.errors import InputError
from stiffdice.experiments.dice import rolls

ROOT = Path(__file__).parents[3]

KNOWN = {"labby-2009": 315_672, "wolf-red": 20_000, "wolf-white": 20_000}


@pytest.mark.parametrize("name", KNOWN)
def test_measured_counts_are_those_published(name):
    found = rolls.load(ROOT / f"config/measurements/{name}.yaml")
    assert found.total == KNOWN[name]
    assert found.source


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("counts: [1, 2, 3, 4, 5]", "counts = .*allowed are six whole numbers >= 0"),
        ("counts: [1, 2, 3, 4, 5, 6, 7]", "counts = .*allowed are six"),
        ("counts: 6", "counts = 6: allowed are six"),
        ("counts: [1, 2, -3, 4, 5, 6]", r"counts\[3\] = -3: allowed is a whole number from 0"),
        ("counts: [1, 2, 3.5, 4, 5, 6]", r"counts\[3\] = 3.5: allowed is a whole number"),
        ("counts: [1, 2, .nan, 4, 5, 6]", r"counts\[3\] = nan: allowed is a whole number"),
        ("counts: [1, 2, many, 4, 5, 6]", r"counts\[3\] = many: allowed is a whole number"),
        ("counts: [1, 2, true, 4, 5, 6]", r"counts\[3\] = True: allowed is a whole number"),
        ("counts: [0, 0, 0, 0, 0, 0]", "counts = .*allowed are counts of one roll at least"),
        ("counts: [1, 2, 3, 4, 5, 6]\ncolour: red", "colour: unknown key; allowed are counts, source, note"),
        ("counts: [1, 2, 3, 4, 5, 6]\nsource: 5", "source = 5: allowed is a text"),
        ("source: me", "counts is missing"),
        ("[1, 2, 3, 4, 5, 6]", "allowed are keys: counts"),
        ("counts: [1, 2", "not valid YAML"),
    ],
)
def test_counts_that_are_not_counts_are_said_with_their_file(text, told, tmp_path):
    path = tmp_path / "counted.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=f"counted.yaml: .*{told}"):
        rolls.load(path)


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.yaml"):
        rolls.load(tmp_path / "nowhere.yaml")
