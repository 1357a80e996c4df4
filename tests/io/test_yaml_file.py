from __future__ import annotations

import math

import pytest

from stiffdice.errors import InputError
from stiffdice.io import yaml_file


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e4", 1e4),
        ("1.0e4", 1e4),
        ("1.0e+4", 1e4),
        ("-2.5E-3", -2.5e-3),
        (".5e1", 5.0),
        ("+1e0", 1.0),
        ("10", 10),
        ("1e", "1e"),
        ("e4", "e4"),
        ("0x10", "0x10"),
        ("010", "010"),
        ("1:30", "1:30"),
        ("1_0", "1_0"),
        ("0", 0),
        ("-0.5", -0.5),
        ("3.", 3.0),
        ("+.5", 0.5),
    ],
)
def test_numbers_are_read_as_people_write_them(text, value):
    assert yaml_file.parse(text) == value
    assert type(yaml_file.parse(text)) is type(value)


def test_special_numbers():
    assert math.isnan(yaml_file.parse(".nan"))
    assert yaml_file.parse("-.inf") == -math.inf


def test_nothing_but_plain_data_is_made(tmp_path):
    with pytest.raises(InputError):
        yaml_file.parse("!!python/name:os.system")


def test_a_huge_file_is_not_read(tmp_path):
    path = tmp_path / "huge.yaml"
    path.write_text("#" * (yaml_file.LARGEST_FILE + 1))
    with pytest.raises(InputError, match="larger than"):
        yaml_file.load(path)


@pytest.mark.parametrize("text", ["[" * 100_000, "a: " * 5000, "&a [*a", "{" * 2000])
def test_nonsense_is_one_line(text):
    with pytest.raises(InputError) as caught:
        yaml_file.parse(text)
    assert "\n" not in str(caught.value)
