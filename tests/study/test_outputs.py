"""What is asked of a result follows from the measurements it stands on, too."""

from __future__ import annotations

from pathlib import Path

import pytest

from stiffdice.study import config, outputs

ROOT = Path(__file__).parents[2]


@pytest.mark.long
def test_other_measurements_are_another_plan(tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    study = config.load("config/tosses.yaml")
    (tmp_path / "config" / "measurements").mkdir(parents=True)
    (tmp_path / "config" / "scenes").symlink_to(ROOT / "config" / "scenes")
    (tmp_path / "workflow").symlink_to(ROOT / "workflow")
    data = tmp_path / "config" / "measurements" / "tosses.h5"
    data.write_bytes((ROOT / "config" / "measurements" / "tosses.h5").read_bytes())
    here, there = outputs.asked(study), outputs.asked(study, tmp_path)
    assert here == there
    data.write_bytes(b"other")
    changed = outputs.asked(study, tmp_path)
    measured = [result for result in here if result.stage == "experiment"]
    assert len(measured) == 5
    for result in measured:
        assert changed[result].plan != here[result].plan
        assert changed[result]._replace(plan="") == here[result]._replace(plan="")
