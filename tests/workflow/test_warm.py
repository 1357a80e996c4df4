"""The warm process: what becomes of jobs when it, or who waits for them, is killed; and that jobs share nothing."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from stiffdice.study import job_log

WORKFLOW = Path(__file__).parents[2] / "workflow"
BEGIN = f"""
import sys, types
sys.path.insert(0, {str(WORKFLOW / "scripts")!r})
from job import begin
begin(sys.argv[1], types.SimpleNamespace(
    rule="work", wildcards={{}}, input={{}}, output=[], log=[sys.argv[2]],
    params=types.SimpleNamespace(asked="scene 0"),
))
"""


@pytest.fixture
def warm(tmp_path, monkeypatch):
    """A warm process of this test's own."""
    address = str(tmp_path / "socket")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(address)
        listener.listen()
        handle = listener.fileno()
        process = subprocess.Popen([sys.executable, str(WORKFLOW / "warm.py"), str(handle)], pass_fds=[handle])
    monkeypatch.setenv("STIFFDICE_WARM", address)
    yield process
    process.kill()
    process.wait()


def begun(folder: Path, name: str, body: str) -> tuple[subprocess.Popen[bytes], Path]:
    """Start a script whose job is `body`; return it, and the job's log. What it prints is in NAME.out."""
    script, log = folder / f"{name}.py", folder / f"{name}.log"
    script.write_text(f"def make(job, say):\n    {body}\n")
    command = [sys.executable, "-c", BEGIN, str(script), str(log)]
    with (folder / f"{name}.out").open("w") as out:
        return subprocess.Popen(command, stdout=out), log


def until(happened) -> None:
    deadline = time.monotonic() + 60
    while not happened():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def at_work(log: Path) -> bool:
    return log.exists() and log.read_text().endswith("here\n")


LONG = "import time; say('here'); time.sleep(60)"


@pytest.mark.long
def test_a_job_is_a_child_of_the_warm_process(warm, tmp_path):
    script, log = begun(tmp_path, "one", "import os; say(str(os.getppid()))")
    assert script.wait() == 0
    assert log.read_text().splitlines()[2] == str(warm.pid)


@pytest.mark.long
def test_jobs_at_once_have_their_own_words_and_share_nothing(warm, tmp_path):
    """What a job prints arrives where its script prints; what it does to a module, no other job sees."""
    bodies = [f"import math; print(math.pi, flush=True); math.pi = {number}" for number in range(4)]
    scripts = [begun(tmp_path, f"job{number}", body)[0] for number, body in enumerate(bodies)]
    assert [script.wait() for script in scripts] == [0] * 4
    assert [path.read_text() for path in tmp_path.glob("*.out")] == ["3.141592653589793\n"] * 4


@pytest.mark.long
def test_a_job_ends_with_the_script_that_waits_for_it(warm, tmp_path):
    script, log = begun(tmp_path, "one", LONG)
    until(lambda: at_work(log))
    script.kill()
    script.wait()
    until(lambda: not job_log.is_alive(job_log.read(log)))
    assert begun(tmp_path, "two", "say('made')")[0].wait() == 0  # and the warm process goes on


@pytest.mark.long
def test_jobs_end_with_the_warm_process_and_later_ones_do_without(warm, tmp_path):
    script, log = begun(tmp_path, "one", LONG)
    until(lambda: at_work(log))
    warm.kill()
    assert script.wait() == 128 + signal.SIGKILL
    until(lambda: not psutil.pid_exists(job_log.read(log).process))
    alone, log = begun(tmp_path, "two", "import os; say(str(os.getppid()))")
    assert alone.wait() == 0
    assert log.read_text().splitlines()[2] == str(os.getpid())


@pytest.mark.long
def test_a_script_that_is_killed_while_it_hands_over_leaves_the_warm_process_at_work(warm, tmp_path):
    for part in (b"", (9).to_bytes(8), (9).to_bytes(8) + b"1"):
        with socket.socket(socket.AF_UNIX) as script:
            script.connect(os.environ["STIFFDICE_WARM"])
            if part:
                socket.send_fds(script, [part], [1, 2])
    assert begun(tmp_path, "next", "say('made')")[0].wait(timeout=60) == 0


@pytest.mark.long
def test_a_job_of_slurm_is_not_handed_over(warm, tmp_path, monkeypatch):
    """It has a node, memory and time of its own."""
    monkeypatch.setenv("SLURM_JOB_ID", "1")
    script, log = begun(tmp_path, "one", "import os; say(str(os.getppid()))")
    assert script.wait() == 0
    assert log.read_text().splitlines()[2] == str(os.getpid())
