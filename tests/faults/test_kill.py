"""kill -9 at any moment, of any part: the same command goes on, and ends with the bytes of an undisturbed run.

STIFFDICE_KILLS says how many kills of the workflow there are in `make test-all`: some of each kind of part unless told.
STIFFDICE_SEED repeats a sequence of kills; when they come still depends on the machine.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter

import numpy as np
import psutil
import pytest

from stiffdice.io import host
from stiffdice.io.writer import write_bytes

FEW, KILLS = 1, int(os.environ.get("STIFFDICE_KILLS", "8"))
SEED = int(os.environ.get("STIFFDICE_SEED", str(time.time_ns() % 10**6)))
A_LIFE = 8  # kills before a life may go on to its end
STARTING = 2.0  # seconds until Snakemake starts its first job, about


class Killer:
    """Starts the workflow of one project after another, and anew after every kill until it has ended well."""

    def __init__(self, rng, seconds: float, names: set[str]):
        self._rng, self._names = rng, names
        self._pace = seconds / len(names)  # seconds a result, at most; measured anew whenever some were made
        self.kills = Counter()
        self._killed = Counter()  # by kind alone: the rarest is next

    def live(self, project, kills: int) -> None:
        last = self.kills.total() + kills
        while self.kills.total() < last:
            if self._start_and_kill(project) == 0:  # it ended before the kill
                break
        done = project.run(str(self._rng.choice(["run.py", "snakemake"])))
        assert done.returncode == 0, done.stdout + done.stderr

    def _start_and_kill(self, project) -> int:
        begun, missing = time.monotonic(), self._missing(project)
        status = self._started_and_killed(project)
        made = missing - self._missing(project)
        if made >= len(self._names) / 4:
            self._pace = max(time.monotonic() - begun - STARTING, 0.5) / made
        return status

    def _missing(self, project) -> int:
        return len(self._names - project.data().keys())

    def _started_and_killed(self, project) -> int:
        """Start it and kill parts at random moments of what is left to do; return its exit status."""
        by = str(self._rng.choice(["run.py", "snakemake"]))
        started = subprocess.Popen(
            project.command(by),
            cwd=project.folder,
            env=project.environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        kind = "job"
        while kind in ("job", "warm process"):  # one job's end is not that of the others
            try:
                return started.wait(self._rng.uniform(0, STARTING + self._pace * self._missing(project)))
            except subprocess.TimeoutExpired:
                kind = self._kill(started, by)
                self.kills[f"{kind} of {by}"] += 1
        return started.wait()

    def _kill(self, started: subprocess.Popen, by: str) -> str:
        """Kill one part, of a kind that was killed least, or all at once, and see that what stands on it ends, too."""
        top = psutil.Process(started.pid)
        everything = [top, *top.children(recursive=True)]
        parts = {"all": everything, by: [top]}
        for process in everything[1:]:
            parts[_kind(process)] = [process]
        fewest = min(self._killed[part] for part in parts)
        kind = str(self._rng.choice(sorted(part for part in parts if self._killed[part] == fewest)))
        self._killed[kind] += 1
        for process in parts[kind]:
            _end(process)
        if kind not in ("job", "warm process") and sys.platform == "linux":
            _, alive = psutil.wait_procs(everything[1:], timeout=60)
            assert not alive, f"{alive} outlived {kind}"
        return kind


def _kind(process: psutil.Process) -> str:
    """Return what a process is: of jobs that are handed over both the script and the child that does it are one."""
    words = _words(process)
    if any(".snakemake/scripts" in word for word in words):
        return "job"
    if any("warm.py" in word for word in words):
        return "job" if any("warm.py" in word for word in _words(process, above=True)) else "warm process"
    return "snakemake"


def _words(process: psutil.Process, *, above: bool = False) -> list[str]:
    """Return the command of a process, or of the one above it; nothing if it has ended in the meantime."""
    try:
        found = process.parent() if above else process
        return found.cmdline() if found else []
    except psutil.Error:
        return []


def _end(process: psutil.Process) -> None:
    with contextlib.suppress(psutil.NoSuchProcess):
        process.kill()


@pytest.mark.workflow
@pytest.mark.parametrize(
    "kills", [pytest.param(FEW, marks=pytest.mark.long), pytest.param(KILLS, marks=pytest.mark.broad)]
)
def test_whatever_is_killed_whenever_the_same_command_ends_with_the_same_data(undisturbed, tmp_path, kills):
    rng, whole = np.random.default_rng(SEED), undisturbed.data()
    killer, lives = Killer(rng, undisturbed.seconds, set(whole)), 0
    while killer.kills.total() < kills:
        lives += 1
        project = undisturbed.copy(tmp_path / f"life-{lives}", results=False)
        killer.live(project, min(kills, A_LIFE))
        found = project.data()
        told = f"seed {SEED}: {lives} lives, {dict(killer.kills)}"
        assert found.keys() == whole.keys(), told
        assert [name for name in whole if found[name] != whole[name]] == [], told
        print(told, flush=True)
    done = project.run("snakemake", "-n")
    assert "Nothing to be done" in done.stdout + done.stderr


# A process that forks one that writes the same file over and over, now with these numbers, now with those; it kills it
# after microseconds to milliseconds, and looks at the file. Forked, because what is imported takes a second.
WRITING = """
import json, os, signal, sys, time
from pathlib import Path
import numpy as np, xarray as xr
from stiffdice.scene import scene
from stiffdice.sweep.shard import compute_shard
from stiffdice.sweep.grid import Piece, Sweep
from stiffdice.io import seal
from stiffdice.io.shard_writer import Spool
from stiffdice.io.writer import write_bytes, write_dataset

WHAT, KILLS, SEED = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
rng = np.random.default_rng(SEED)
numbers = [np.random.default_rng(k).random((8, 2000)) for k in range(2)]

def dataset(k):
    return xr.Dataset({"ratio": (("cell", "member"), numbers[k])}, attrs={"format_version": "1.2"})

def by_bytes(k, path):
    write_bytes(numbers[k].tobytes(), path, seal.line_of(numbers[k].tobytes()))

def by_dataset(k, path):
    write_dataset(dataset(k), path)

def by_spool(k, path):
    with Spool(path, dataset(k).isel(cell=slice(1))) as spool:
        for cell in range(8):
            first = spool.add_cells(1)
            spool.put({"ratio": numbers[k][cell:cell + 1]}, slice(first, first + 1))

def by_shard(k, path):
    plan = Sweep(
        scene=scene.load("config/scenes/figure-13.yaml"), model="sliding", scheme="symplectic_euler",
        contact=("gated",), stiffness={"from": 1e2, "to": 1e3, "count": 2},
        omega_h={"from": 3.0, "to": 1.0, "count": 4}, members=2, seed=k, criteria={"energy": 0.1}, horizon=1.0,
    )
    compute_shard(plan, [Piece(column, tuple(plan.scan(column))) for column in plan.columns()], path)

write = globals()["by_" + WHAT]
target = Path("target.h5")
wholes = set()
for k in range(2):
    begun = time.perf_counter()
    write(k, target)
    took = time.perf_counter() - begun
    wholes.add(target.read_bytes())
assert len(wholes) == 2
left = 0
for _ in range(KILLS):
    child = os.fork()
    if child == 0:
        while True:
            for k in range(2):
                write(k, target)
    time.sleep(10 ** rng.uniform(-5, np.log10(4 * took)))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    assert target.read_bytes() in wholes
    seal.check(target)
    left += any(entry.name != "target.h5" for entry in Path().iterdir() if "target" in entry.name)
write(0, target)
print(json.dumps({"left": left, "there": sorted(entry.name for entry in Path().iterdir() if "target" in entry.name)}))
"""


@pytest.mark.parametrize("what", ["bytes", "dataset", "spool", pytest.param("shard", marks=pytest.mark.broad)])
@pytest.mark.long
def test_a_killed_writer_leaves_the_old_file_or_the_new_one(undisturbed, tmp_path, what):
    (tmp_path / "config").symlink_to(undisturbed.folder / "config")
    kills = max(40, KILLS)
    command = [sys.executable, "-c", WRITING, what, str(kills), str(SEED)]
    done = subprocess.run(
        command, cwd=tmp_path, env=undisturbed.environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"seed {SEED}: {done.stderr}"
    told = json.loads(done.stdout)
    assert told["left"] > 0 or what == "dataset"  # kills did come while it wrote; that one is made in memory
    assert told["there"] == ["target.h5"]  # what they left is gone with the next file


TWO = """
import os, sys
import numpy as np, xarray as xr
from stiffdice.io.shard_writer import Spool
from stiffdice.io.writer import write_dataset
whole = xr.Dataset({"ratio": (("cell", "member"), np.ones((8, 500)))}, attrs={"format_version": "1.2"})
def spooled(path):
    with Spool(path, whole.isel(cell=slice(1))) as spool:
        spool.put({"ratio": whole.ratio.values}, slice(spool.add_cells(8), 8))
children = []
for _ in range(3):
    children.append(os.fork())
    if children[-1] == 0:
        for _ in range(30):
            write_dataset(whole, "dataset.h5")
            spooled("spool.h5")
        os._exit(0)
assert [os.waitpid(child, 0)[1] for child in children] == [0, 0, 0]
"""


@pytest.mark.long
def test_writers_of_one_file_at_once_all_succeed(tmp_path):
    done = subprocess.run([sys.executable, "-c", TWO], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["dataset.h5", "spool.h5"]


def test_only_what_the_dead_of_this_host_left_is_removed(tmp_path):
    gone = subprocess.Popen(["true"])
    gone.wait()
    here = host.name()
    names = [
        f".x.h5.{here}.{gone.pid}.part",
        f".x.h5.{here}.{os.getpid()}0.part",  # no process has such a number
        f".x.h5.{here}.{os.getppid()}.part",
        f".x.h5.elsewhere.{gone.pid}.part",
        f".y.h5.{here}.{gone.pid}.part",
    ]
    for name in names:
        (tmp_path / name).write_text("half")
    write_bytes(b"whole", tmp_path / "x.h5")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == sorted([*names[2:], "x.h5"])


linux = pytest.mark.skipif(sys.platform != "linux", reason="other systems have no way to ask for it")


@linux
@pytest.mark.long
def test_a_process_ends_with_its_parent():
    child = "from stiffdice.io.process import end_with_parent; end_with_parent('python'); print(1, flush=True); input()"
    parent = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    started = subprocess.Popen([sys.executable, "-c", parent], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert started.stdout.readline() == b"1\n"
    children = psutil.Process(started.pid).children()
    started.send_signal(signal.SIGKILL)
    started.wait()
    assert psutil.wait_procs(children, timeout=60)[1] == []
    started.stdin.close()
    started.stdout.close()


@linux
@pytest.mark.long
def test_a_process_whose_parent_is_gone_already_does_not_begin(tmp_path):
    child = (
        "import os, sys, time\nfrom pathlib import Path\nfrom stiffdice.io.process import end_with_parent\n"
        "while os.getppid() == int(sys.argv[1]): time.sleep(0.01)\n"
        "Path('told').write_text(f'{os.getpid()} {os.getppid()} \\n')\n"
        "end_with_parent('no such program')\nPath('begun').touch()"
    )
    parent = f"import os, subprocess, sys; subprocess.Popen([sys.executable, '-c', {child!r}, str(os.getpid())])"
    subprocess.run([sys.executable, "-c", parent], cwd=tmp_path, check=True)
    told = tmp_path / "told"
    while not (told.exists() and told.read_text().endswith("\n")):
        time.sleep(0.05)
    process, heir = map(int, told.read_text().split())
    if heir != 1:
        pytest.skip("orphans are inherited by another than process 1 here")
    while psutil.pid_exists(process):
        time.sleep(0.05)
    assert not (tmp_path / "begun").exists()
