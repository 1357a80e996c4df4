"""A number in a file means what the registries say, whatever words the file has for it."""

from __future__ import annotations

from pathlib import Path

import pytest

from stiffdice.archive.consistency import words
from stiffdice.archive.verify import verify
from stiffdice.io.reader import open_file
from stiffdice.io.writer import write_dataset
from stiffdice.report import file_page

FORMATS = Path(__file__).parents[2] / "reference" / "formats"
FILES = sorted(FORMATS.glob("*/*.h5"))
NEWEST = FORMATS / "1.3"


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_files_of_every_version_have_the_words_of_the_registries(path):
    assert words.problems(open_file(path)) == []


def swapped(dataset, name, first, second):
    """The same with two words of an enum in each other's place."""
    other = dataset.copy()
    text = str(other[name].attrs["flag_meanings"]).split()
    a, b = text.index(first), text.index(second)
    text[a], text[b] = second, first
    other[name].attrs["flag_meanings"] = " ".join(text)
    return other


@pytest.mark.parametrize(
    ("kind", "name", "first", "second"),
    [
        ("run", "verdict", "passed", "energy_grew"),
        ("run", "ending", "passed", "unresolved"),
        ("run", "axis", "x", "z"),
        ("run", "bounce_ended", "in_contact", "in_air"),
        ("shard", "verdict", "passed", "energy_grew"),
        ("shard", "contact", "gated", "ungated"),
        ("shard", "criterion", "energy", "apex"),
        ("sweep", "contact", "gated", "ungated"),
        ("sweep", "criterion", "energy", "apex"),
        ("sweep", "verdict", "passed", "sank"),
        ("frontier", "criterion", "energy", "apex"),
        ("frontier", "cell_contact", "gated", "ungated"),
        ("frontier", "edge", "first_pass", "last_fail"),
    ],
)
def test_words_that_changed_places_are_told(kind, name, first, second, tmp_path):
    path = tmp_path / f"{kind}.h5"
    write_dataset(swapped(open_file(NEWEST / f"{kind}.h5"), name, first, second), path)
    report = verify(path)
    assert any(problem.reason.startswith(f"{name}: flag_meanings = ") for problem in report.problems), report.lines()


def test_words_that_a_later_version_adds_are_read_and_words_that_are_gone_are_not():
    run = open_file(NEWEST / "run.h5")
    known = str(run.verdict.attrs["flag_meanings"])
    run.verdict.attrs["flag_meanings"] = f"{known} exploded"
    assert words.problems(run) == []
    run.verdict.attrs["flag_meanings"] = known.replace("apex_rose ", "")
    assert words.problems(run)
    del run.verdict.attrs["flag_meanings"]
    assert words.problems(run) == [f"verdict: flag_meanings = : allowed are {known}, in this order"]


def test_a_sweep_has_the_criteria_whose_measures_it_holds():
    sweep = open_file(NEWEST / "sweep.h5")
    sweep.criterion.attrs["flag_meanings"] = "energy restitution"
    assert words.problems(sweep) == [
        "criterion: flag_meanings = energy restitution: allowed are energy apex, in this order"
    ]


@pytest.mark.parametrize(("kind", "name"), [("frontier", "criterion"), ("frontier", "edge"), ("run", "axis")])
def test_a_dimension_counts_its_words(kind, name):
    dataset = open_file(NEWEST / f"{kind}.h5")
    turned = dataset.assign_coords({name: (name, dataset[name].values[::-1], dataset[name].attrs)})
    assert any(line.startswith(f"{name} = ") for line in words.problems(turned))


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.2"])
def test_a_text_of_an_older_file_about_its_verdict_is_not_what_is_shown(version):
    run = open_file(FORMATS / version / "run.h5")
    lying = run.assign_attrs(verdict_text="energy grew: by far")
    for dataset in (run, lying):
        text = file_page.as_text(dataset, "run.h5")
        assert "  passed: every criterion that was looked at holds" in text and "energy grew" not in text


def test_a_run_of_today_does_not_say_its_verdict_twice():
    assert "verdict_text" not in open_file(NEWEST / "run.h5").attrs
