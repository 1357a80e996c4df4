from __future__ import annotations

import os
import subprocess
import sys

import pytest

from stiffdice.study import disk_usage


@pytest.fixture
def write(tmp_path):
    def write(name, size):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"x" * size)

    return write


def test_every_byte_is_counted_once(tmp_path, write):
    sizes = {"runs/a.h5": 1, "sweeps/s/shards/b.h5": 20, "sweeps/s/sweep.h5": 300, "logs/shard/s/b.log": 4000}
    sizes |= {"report.html": 50_000, "strange/c": 600_000, "sweeps/s/shards/old.h5": 7_000_000}
    for name, size in sizes.items():
        write(name, size)
    use = disk_usage.of(tmp_path, {"sweeps/s/shards/b.h5"})
    assert use.kinds == {"runs": 1, "shards": 7_000_020, "sweeps": 300, "logs": 4000, "other": 650_000}
    assert use.total == sum(sizes.values())
    assert use.stale == {"sweeps/s/shards/old.h5": 7_000_000}


def test_what_is_no_result_is_named(tmp_path, write):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    mine, theirs = (f"runs/.a.h5.{process}.part" for process in (os.getpid(), gone.pid))
    write(mine, 3)
    write(theirs, 5)
    write("sweeps/s/shards/b.h5.damaged", 7)
    use = disk_usage.of(tmp_path, set())
    assert (use.kinds["unfinished"], use.leftover) == (8, {theirs: 5})
    assert (use.damaged, use.stale) == ({"sweeps/s/shards/b.h5.damaged": 7}, {})
    assert use.total == 15


def test_links_are_not_followed(tmp_path, write):
    write("runs/a.h5", 1000)
    (tmp_path / "runs" / "loop").symlink_to(tmp_path)
    (tmp_path / "runs" / "b.h5").symlink_to("a.h5")
    assert disk_usage.of(tmp_path, set()).total < 2000


def test_no_folder_takes_nothing(tmp_path):
    assert disk_usage.of(tmp_path / "nowhere", set()).total == 0
