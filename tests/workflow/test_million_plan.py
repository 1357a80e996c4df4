"""A million runs are planned in few jobs and in little memory. No time is asserted."""

from __future__ import annotations

from pathlib import Path

import pytest

from stiffdice.bench.scale.project import Project
from stiffdice.io import yaml_file

ROOT = Path(__file__).parent.parent.parent


@pytest.mark.workflow
def test_a_dry_run_of_a_million_runs_has_some_hundred_jobs_and_stays_small(tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    project = Project(tmp_path / "project", ROOT)
    project.plan("million", yaml_file.load("config/million.yaml"))
    jobs, taken = project.dry_run("million")
    assert 10 <= jobs <= 500
    assert taken.peak < 500e6
