"""A million runs are planned in few jobs and in little memory. No time is asserted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from benchmarks.scale.project import Project

from stiffdice.io import yaml_loader
from stiffdice.sweep import partition

ROOT = Path(__file__).parent.parent.parent


@pytest.mark.workflow
@pytest.mark.long
def test_a_dry_run_of_a_million_runs_has_sixteen_equal_jobs_a_sweep_and_stays_small(tmp_path, monkeypatch):
    """Sixteen jobs share the work of a sweep this cheap; where a contact law ends there is a shorter one."""
    monkeypatch.chdir(ROOT)
    project = Project(tmp_path / "project", ROOT)
    sweeps = project.plan("million", yaml_loader.load("config/million.yaml")).sweeps.values()
    of_sweeps = [[shard.seconds for shard in partition.of(sweep).values()] for sweep in sweeps]
    for sweep, seconds in zip(sweeps, of_sweeps, strict=True):
        assert 16 <= len(seconds) <= 16 + len(sweep.contact)
        assert max(seconds) < 1.5 * np.median(seconds)
    jobs, taken = project.dry_run("million")
    # Besides, each sweep is collected, searched for its edges and drawn; one job asks for all.
    assert jobs == sum(map(len, of_sweeps)) + 3 * len(sweeps) + 1
    assert taken.peak < 500e6
