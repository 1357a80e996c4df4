from __future__ import annotations

import math

import pytest

from stiffdice.errors import InputError
from stiffdice.io import yaml_loader
from stiffdice.scene import scene


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
    assert yaml_loader.parse(text) == value
    assert type(yaml_loader.parse(text)) is type(value)


def test_special_numbers():
    assert math.isnan(yaml_loader.parse(".nan"))
    assert yaml_loader.parse("-.inf") == -math.inf


def test_nothing_but_plain_data_is_made(tmp_path):
    with pytest.raises(InputError):
        yaml_loader.parse("!!python/name:os.system")


def test_a_huge_file_is_not_read(tmp_path):
    path = tmp_path / "huge.yaml"
    path.write_text("#" * (yaml_loader.LARGEST_FILE + 1))
    with pytest.raises(InputError, match="larger than"):
        yaml_loader.load(path)


@pytest.mark.parametrize("text", ["[" * 100_000, "a: " * 5000, "&a [*a", "{" * 2000])
@pytest.mark.long
def test_nonsense_is_one_line(text):
    with pytest.raises(InputError) as caught:
        yaml_loader.parse(text)
    assert "\n" not in str(caught.value)


LAUGHS = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join(9 * [f'*{before}'])}]\n"
    for before, name in zip("abcdefghijk", "bcdefghijkl", strict=True)
)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (LAUGHS, "more than 20000 values"),
        ("&a [*a]", "line 1: not valid YAML: found .*recursive|holds itself"),
        ("b: 1\na: &a {x: *a}", "line 2: not valid YAML: .*holds itself"),
        ("a: &a\n  <<: *a\n", "holds itself"),
        ("mass: 1" + "0" * 5000, "line 1: a number of 5001 digits: allowed are 1000"),
        ("!!python/object/apply:os.system ['true']", "line 1: .*: tag tag:yaml.org,2002:python/object/apply"),
        ("a: 1\nb: !!binary aGk=", "line 2: .*: tag tag:yaml.org,2002:binary: allowed are values without tags"),
        ("!!timestamp x", "tag tag:yaml.org,2002:timestamp"),
        ("!!int ''", "tag"),
        ("!!set {a}", "tag"),
        ("!mine {a: 1}", "tag !mine"),
        ("1: 2", "line 1: a key must be a word"),
        ("yes: 2", "line 1: a key must be a word"),
        ("~: 2", "line 1: a key must be a word"),
        (".nan: 2", "line 1: a key must be a word"),
        ("? {a: 1}\n: 2", "line 1: a key must be a word"),
        ("a: 1\na: 2", "line 2: key a is given twice"),
        ("a:\n\tb: 1", "line 2: not valid YAML"),
        ("a: 1\n---\nb: 2", "line 2: not valid YAML"),
        ("%YAML 9.9\n--- 1", "not valid YAML"),
        ("a: \0", "not valid YAML"),
        ("*nowhere", "line 1: not valid YAML: found undefined alias"),
    ],
)  # fmt: skip
def test_what_is_no_plain_data_is_refused_in_one_line(text, told):
    with pytest.raises(InputError, match=told) as caught:
        yaml_loader.parse(text)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("text", ["2001-01-01", "2001-12-14t21:59:43.10-05:00", "="])
def test_what_yaml_takes_for_something_else_is_text(text):
    assert yaml_loader.parse(text) == text


def test_aliases_that_repeat_a_little_are_read():
    assert yaml_loader.parse("a: &a {x: 1, y: 2}\nc: [*a, *a]") == {"a": {"x": 1, "y": 2}, "c": [{"x": 1, "y": 2}] * 2}


def test_nothing_is_merged():
    assert yaml_loader.parse("a: &a {x: 1}\nb: {<<: *a}") == {"a": {"x": 1}, "b": {"<<": {"x": 1}}}


@pytest.mark.parametrize("text", ["{'a\\nb': 1}", '{"\\e[2J": 1}', '{"\\u2028": 1}', "{'" + "x" * 500 + "': 1}"])
def test_what_a_file_says_cannot_break_the_line_that_is_told(tmp_path, text):
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match="unknown key; allowed are preset") as caught:
        scene.load(path)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 300 + len(str(path))
