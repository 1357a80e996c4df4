"""A machine without room: full disks, folders that cannot be written, no more files to open. One line, and no loss.

Full disks and read-only folders are mounted in a namespace of the test's own, where that is allowed.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tests.faults.conftest import Project

IN_NAMESPACE = ["unshare", "--mount", "sh", "-euc"]


def may_mount() -> bool:
    try:
        return (
            subprocess.run([*IN_NAMESPACE, "mount -t tmpfs none /mnt"], capture_output=True, check=False).returncode
            == 0
        )
    except OSError:
        return False


mounted = pytest.mark.skipif(not may_mount(), reason="mounting is not allowed here")


def shell(project, script: str, **changes: str) -> subprocess.CompletedProcess[str]:
    """Run a script in a project's folder with mounts of its own; `$RUN` is the workflow."""
    run = " ".join(project.command())
    return subprocess.run(
        [*IN_NAMESPACE, script],
        cwd=project.folder,
        env=project.environment | {"RUN": run} | changes,
        capture_output=True,
        text=True,
        check=False,
    )


def with_a_shard_missing(undisturbed, folder):
    """Return a finished project that has a shard, and what stands on it, to make."""
    project = undisturbed.copy(folder)
    (shard, *_) = sorted((project.results / "sweeps/steps/shards").glob("*.h5"))
    shard.unlink()
    return project, shard.relative_to(project.folder)


# Results on a disk with so much room left; then on a larger one.
FILLING = """
cp -a results whole
mount -t tmpfs -o size=64m none results
cp -a whole/. results
mount -o remount,size=$(($(df -k --output=used results | tail -1) + ROOM))k results
$RUN > first.out 2>&1 && exit 9
find results -name '.*.part' -o -name "$(basename $SHARD)" > left
mount -o remount,size=64m results
$RUN > second.out 2>&1
cp -a results/. whole
"""


@mounted
@pytest.mark.workflow
@pytest.mark.long
# KiB: the disk is full when a job stores its result; or at once.
@pytest.mark.parametrize("room", [64, pytest.param(8, marks=pytest.mark.broad)])
def test_a_full_disk_is_told_and_the_same_command_goes_on(undisturbed, tmp_path, room):
    project, shard = with_a_shard_missing(undisturbed, tmp_path / "project")
    done = shell(project, FILLING, ROOM=str(room), SHARD=str(shard))
    first = (project.folder / "first.out").read_text()
    assert done.returncode == 0, first + (project.folder / "second.out").read_text()
    told = [line for line in first.splitlines() if line.startswith("stiffdice: ")]
    assert any("No space left on device" in line for line in told), first
    assert "Traceback" not in first
    assert (project.folder / "left").read_text() == ""
    shutil.rmtree(project.folder / "results")
    (project.folder / "whole").rename(project.folder / "results")
    assert project.data() == undisturbed.data()


@mounted
@pytest.mark.parametrize("name", ["results", ".snakemake"])
@pytest.mark.parametrize("kind", ["read-only", "full"])
@pytest.mark.long
def test_a_folder_that_cannot_be_written_is_one_line_before_anything_is_done(undisturbed, tmp_path, name, kind):
    project = undisturbed.copy(tmp_path / "project")
    mounts = {
        "read-only": f"mount --bind {name} {name}; mount -o remount,bind,ro {name}",
        "full": f"mount -t tmpfs -o size=16k none {name}",
    }
    done = shell(project, f"{mounts[kind]}; $RUN")
    told = {"read-only": "Read-only file system", "full": "No space left on device"}[kind]
    go_on = "the same command goes on once files can be written there"
    assert done.stderr == f"stiffdice: {project.folder / name}: {told}; {go_on}\n"
    assert done.returncode == 2
    assert project.data() == undisturbed.data()


FULL = "mkdir -p {0}; mount -t tmpfs -o size=16k none {0}; (head -c 64k /dev/zero > {0}/filling) 2> /dev/null || true;"


@mounted
@pytest.mark.workflow
@pytest.mark.long
@pytest.mark.skipif(
    any(str(Path(place).resolve()).startswith("/tmp/") for place in (sys.prefix, sys.base_prefix)),
    reason="Python itself is in /tmp",
)
def test_a_full_tmp_and_a_full_home_do_no_harm(undisturbed, tmp_path):
    """The project lies elsewhere meanwhile: /tmp is covered. Compiled kernels have nowhere to be but with Snakemake."""
    project = undisturbed.copy(tmp_path / "project")
    (project.folder / "src").unlink()
    shutil.copytree(undisturbed.folder / "src", project.folder / "src")
    (project.results / "tables/answers.md").unlink()
    full = "".join(FULL.format(folder) for folder in ("/tmp", "/var/tmp", "/mnt/home"))
    script = f"mount --bind . /mnt; cd /mnt; {full} $RUN"
    unset = {"TMPDIR": "", "XDG_CACHE_HOME": "", "NUMBA_CACHE_DIR": ""}
    done = shell(project, script, HOME="/mnt/home", PYTHONPATH="/mnt/src", **unset)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "stiffdice: /tmp: No space left on device; /mnt/.snakemake/tmp is used instead\n" in done.stderr
    assert "/mnt/home/.cache: No space left on device; /mnt/.snakemake/cache is used instead\n" in done.stderr
    assert "Traceback" not in done.stderr
    assert project.data() == undisturbed.data()


@mounted
@pytest.mark.long
def test_nowhere_to_keep_compiled_kernels_is_one_line(tmp_path):
    """Every place that Python would take for temporary files is read-only."""
    places = (
        "for place in / /tmp /var/tmp; do mount --bind $place $place; mount -o remount,bind,ro $place; done; cd /tmp;"
    )
    project = Project.new(tmp_path / "project")
    command = f"{sys.executable} -m stiffdice.cli run {project.folder}/config/scenes/figure-09.yaml -o /dev/shm/out.h5"
    done = shell(project, f"{places} {command}", HOME="/", TMPDIR="", XDG_CACHE_HOME="", NUMBA_CACHE_DIR="")
    assert done.returncode == 2, done.stdout + done.stderr
    note, told = done.stderr.splitlines()
    assert note.startswith("stiffdice: note: 10,000 steps are beyond the limit")
    assert told.startswith("stiffdice: compiled kernels: neither /.cache nor a folder for temporary files can")


def test_too_few_files_to_open_is_one_line(tmp_path):
    project = Project.new(tmp_path / "project")
    command = ["sh", "-c", "ulimit -n 16; " + " ".join(project.command())]
    done = subprocess.run(
        command, cwd=project.folder, env=project.environment, capture_output=True, text=True, check=False
    )
    assert done.stderr == "stiffdice: 16 files may be open at a time (ulimit -n); 2 cores need 32\n"
    assert done.returncode == 2


@pytest.mark.workflow
@pytest.mark.broad
def test_as_many_files_to_open_as_it_asks_for_are_enough(undisturbed, tmp_path):
    project, _ = with_a_shard_missing(undisturbed, tmp_path / "project")
    command = ["sh", "-c", "ulimit -n 32; " + " ".join(project.command())]
    done = subprocess.run(
        command, cwd=project.folder, env=project.environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert project.data() == undisturbed.data()


NO_MORE = """
import os, resource
import numpy as np, xarray as xr
from stiffdice.errors import StiffdiceError
from stiffdice.io.reader import open_file
from stiffdice.io.shard_writer import Spool
from stiffdice.io.writer import write_dataset
about = {"units": "1", "long_name": "a number"}
whole = xr.Dataset({"ratio": (("cell", "member"), np.ones((1, 9)), about)}, attrs={"format_version": "1.0"})
write_dataset(whole, "in.h5")
with Spool("spool.h5", whole):
    pass
open_file("in.h5")
free = os.open(".", os.O_RDONLY)
os.close(free)
resource.setrlimit(resource.RLIMIT_NOFILE, (free, free))
def spooled():
    with Spool("out.h5", whole):
        pass
for act in (lambda: write_dataset(whole, "out.h5"), spooled, lambda: open_file("in.h5")):
    try:
        act()
    except StiffdiceError as error:
        print(error)
"""


@pytest.mark.long
def test_no_file_to_open_is_one_line_and_nothing_is_stored(tmp_path):
    command = [sys.executable, "-c", NO_MORE]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "out.h5: Too many open files; nothing was stored",
        "out.h5: Too many open files; nothing was stored",
        "in.h5: Too many open files",
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.h5", "spool.h5"]
