from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from stiffdice.study import eta, job_log
from stiffdice.study.eta import Job, Left, of
from stiffdice.study.outputs import Result


def done(kind, weight, took):
    return Job(kind, weight, took, due=False)


def due(kind, weight=1.0, took=None, **more):
    return Job(kind, weight, took, due=True, **more)


@pytest.mark.parametrize(
    ("jobs", "cores", "left"),
    [
        ([], 1, 0),
        ([done("shard", 2, 10)], 1, 0),
        ([due("shard")], 1, 2),  # nothing has ended: as foretold
        ([due("shard", took=7)], 1, 7),  # as long as it took before
        ([done("shard", 2, 10), due("shard", 3)], 1, 15),  # as its kind, by weight
        ([done("shard", 1, 1), done("shard", 1, 3), done("shard", 1, 50), due("shard")], 1, 3),  # the median
        ([done("figure", 2, 10), due("shard", 3)], 1, 15),  # as all others, where none of its kind has ended
        ([done("figure", 2, 10), done("shard", 1, 1), due("shard", 3)], 1, 3),
        ([due("shard", took=10) for _ in range(4)], 2, 20),
        ([due("shard", took=30), due("shard", took=2)], 8, 30),  # the longest, if there are cores enough
        ([due("shard", took=10), due("time", took=5, alone=True), due("time", took=5, alone=True)], 2, 20),
        ([due("shard", took=10, elapsed=4)], 1, 6),
        ([due("shard", took=10, elapsed=40)], 1, 0),  # longer than expected
    ],
)
def test_time_left(jobs, cores, left):
    assert of(jobs, cores, pace=2.0) == Left(left, cores)


@pytest.mark.parametrize(("progress", "took"), [(0.4, 50), (0.0, 10)])
def test_a_running_job_takes_as_long_as_its_progress_says(tmp_path, progress, took):
    """It has run for 30 s, and said after 20 s how far it was; it took 10 s before."""
    (tmp_path / "log").write_text(f"{job_log.begun()}\n")
    log, now = job_log.read(tmp_path / "log"), datetime.now(UTC)
    log = log._replace(begun=now - timedelta(seconds=30), written=now - timedelta(seconds=10), progress=progress)
    job = eta.job(Result("shard", "one/0123", ()), 2.0, log, due=True, took=10)
    assert job == ("shard one", 2.0, pytest.approx(took), True, pytest.approx(30, abs=1), False)
