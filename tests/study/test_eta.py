from __future__ import annotations

import pytest

from stiffdice.study.eta import Job, Left, of


def done(kind, weight, took):
    return Job(kind, weight, took, due=False)


def due(kind, weight=1.0, took=None, **more):
    return Job(kind, weight, took, due=True, **more)


@pytest.mark.parametrize(
    ("jobs", "cores", "left"),
    [
        ([], 1, (0, 0)),
        ([done("shard", 2, 10)], 1, (0, 0)),
        ([due("shard")], 1, (0, 1)),  # nothing is known
        ([due("shard", took=7)], 1, (7, 0)),  # as long as it took before
        ([done("shard", 2, 10), due("shard", 3)], 1, (15, 0)),  # as its kind, by weight
        ([done("shard", 1, 1), done("shard", 1, 3), done("shard", 1, 50), due("shard")], 1, (3, 0)),  # the median
        ([done("figure", 2, 10), due("shard", 3)], 1, (0, 1)),  # not as another kind
        ([due("shard", took=10) for _ in range(4)], 2, (20, 0)),
        ([due("shard", took=30), due("shard", took=2)], 8, (30, 0)),  # the longest, if there are cores enough
        ([due("shard", took=10), due("time", took=5, alone=True), due("time", took=5, alone=True)], 2, (20, 0)),
        ([due("shard", took=10, elapsed=4)], 1, (6, 0)),
        ([due("shard", took=10, elapsed=40)], 1, (0, 1)),  # longer than expected
        ([due("shard", took=10, elapsed=30, progress=0.4, told=20)], 1, (20, 0)),  # 50 s in all, by its progress
        ([due("shard", 2, elapsed=20, progress=0.5, told=20), due("shard", 3)], 1, (20 + 60, 0)),
    ],
)
def test_time_left(jobs, cores, left):
    assert of(jobs, cores) == Left(*left, cores)


def test_a_pace_stands_in_where_no_job_of_a_kind_has_ended():
    jobs = [done("shard", 2, 10), due("shard", 3), due("figure", 3), due("table", 3, took=1)]
    assert of(jobs, 1, pace=2.0) == Left(15 + 6 + 1, 0, 1)
