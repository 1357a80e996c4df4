"""What is told of a file is what it holds."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import h5py
import pytest

from stiffdice.io.reader import open_file
from stiffdice.report import file_page

FORMATS = Path(__file__).parents[1] / "reference" / "formats"


@pytest.mark.parametrize("version", ["1.1", "1.2", "1.3"])
def test_the_verdicts_of_a_sweep_are_those_of_its_runs(version):
    """Each cell of a judged sweep says how many of its members ended how."""
    path = FORMATS / version / "sweep.h5"
    wanted: Counter[str] = Counter()
    with h5py.File(path) as file:
        names = file["verdict"].attrs["flag_meanings"].split()
        for cell in file["verdicts"][:]:
            wanted.update(dict(zip(names, cell.tolist(), strict=True)))
        runs = file["verdicts"][:].sum()
        assert runs == len(file["cell"]) * file.attrs["members"]
    dataset = open_file(path)
    assert json.loads(file_page.as_json(dataset))["verdicts"] == {name: n for name, n in wanted.items() if n}
    lines = file_page.as_text(dataset, "sweep.h5").splitlines()
    assert f"  passed: {wanted['passed']} of {runs} runs ({wanted['passed'] / runs:.1%})" in lines


def test_the_verdicts_of_a_shard_are_those_of_its_runs():
    dataset = open_file(FORMATS / "1.2" / "shard.h5")
    assert sum(json.loads(file_page.as_json(dataset))["verdicts"].values()) == dataset.verdict.size


@pytest.mark.parametrize("name", ["frontier.h5", "experiment.h5"])
def test_a_file_without_runs_has_no_verdicts(name):
    dataset = open_file(FORMATS / "1.2" / name)
    assert json.loads(file_page.as_json(dataset))["verdicts"] == {}
    assert "  none: this file holds no runs" in file_page.as_text(dataset, name).splitlines()


def test_an_apex_ratio_that_nothing_was_measured_for_is_not_shown_as_a_number():
    run = open_file(FORMATS / "1.2" / "run.h5")
    assert "apex_ratio = " in file_page.as_text(run, "run.h5")
    none = file_page.as_text(run.assign(apex_ratio=run.apex_ratio * 0), "run.h5")
    assert "apex_ratio: no rebound to compare" in none
