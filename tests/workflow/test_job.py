"""What a job's log says, however the job ends: scripts as Snakemake runs them, but without Snakemake.

Each test is done twice: by a script that does its job itself, and by one that hands it over to the warm process.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from stiffdice.study import job_log

SCRIPTS = Path(__file__).parents[2] / "workflow" / "scripts"
# Snakemake runs a script with such an object, from the folder of the script.
BEGIN = f"""
import sys, types
sys.path.insert(0, {str(SCRIPTS)!r})
from job import begin
begin(f"{{sys.argv[1]}}/work.py", types.SimpleNamespace(
    rule="work", wildcards={{}}, input={{}}, output=[], log=[sys.argv[2]],
    params=types.SimpleNamespace(asked="scene 0"),
))
"""


WARM = SCRIPTS.parent / "warm.py"
IN_BLOCK = "def make(job, say):\n    "


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """Where a warm process listens; it ends after the tests of this file."""
    place = str(tmp_path_factory.mktemp("warm") / "socket")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(place)
        listener.listen()
        handle = listener.fileno()
        process = subprocess.Popen([sys.executable, str(WARM), str(handle)], pass_fds=[handle])
    yield place
    process.kill()
    process.wait()


@pytest.fixture(autouse=True, params=["alone", "handed over"])
def how(request, monkeypatch):
    """Whether a script does its job itself."""
    if request.param == "alone":
        monkeypatch.delenv("STIFFDICE_WARM", raising=False)
    else:
        monkeypatch.setenv("STIFFDICE_WARM", request.getfixturevalue("address"))
    return request.param


def script(*lines: str, log) -> list[str]:
    """Return the command of a job that does what the lines say: some in `make`, some before it."""
    folder = Path(tempfile.mkdtemp())
    (folder / "work.py").write_text("\n".join(lines))
    return [sys.executable, "-c", BEGIN, str(folder), str(log)]


def run(*lines: str, log) -> subprocess.CompletedProcess[str]:
    return subprocess.run(script(*lines, log=log), capture_output=True, text=True, check=False)


@pytest.mark.long
def test_a_job_that_does_what_it_should(tmp_path):
    log = tmp_path / "log"
    ended = run(IN_BLOCK + "say('simulation: 1.000 s')", log=log)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
    first, asked, said, memory, last = log.read_text().splitlines()
    assert first.startswith("begun 20")
    assert asked == "asked: scene 0"
    assert said == "simulation: 1.000 s"
    assert 10 < int(memory.removeprefix("memory: ").removesuffix(" MB")) < 10_000
    assert last.startswith("done in ")
    assert job_log.read(log).ending == "done"


OURS = "from stiffdice.errors import OutputError; raise OutputError('x.h5: no room')"
NO_HANDLES = (
    "import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (8, 8)); files = [open('/dev/null') for _ in range(9)]"
)


@pytest.mark.parametrize(
    ("line", "status", "reason"),
    [
        (IN_BLOCK + OURS, 2, "x.h5: no room"),
        (IN_BLOCK + "import numpy; numpy.empty(1 << 57)", 1, "not enough memory (Unable to allocate 1.00 EiB for an"),
        (IN_BLOCK + NO_HANDLES, 1, "/dev/null: Too many open files"),
        (IN_BLOCK + "1 / 0", 1, "a mistake in the program: ZeroDivisionError: division by zero"),
        ("import nowhere", 1, "a mistake in the program: ModuleNotFoundError: No module named 'nowhere'"),
    ],
)
@pytest.mark.long
def test_an_error_is_the_last_word(tmp_path, line, status, reason):
    """And what is said aloud is one line, in which the log is named; a traceback only in the log, if at all."""
    log = tmp_path / "log"
    ended = run(line, log=log)
    assert ended.returncode == status
    assert job_log.read(log).ending == "failed"
    assert job_log.read(log).reason.startswith(reason)
    assert ended.stderr.startswith(f"stiffdice: {log}: failed: {reason}")
    assert ended.stderr.count("\n") == 1
    assert ("Traceback" in log.read_text()) == (status == 1)


@pytest.mark.parametrize(
    ("number", "status", "ending", "reason"),
    [
        (signal.SIGTERM, 143, "interrupted", "told to stop (SIGTERM)"),
        (signal.SIGINT, 130, "interrupted", "told to stop (SIGINT)"),
        (signal.SIGKILL, -9, "", ""),
    ],
)
def test_a_signal_is_the_last_word_if_it_leaves_time_for_one(tmp_path, number, status, ending, reason):
    log, tidy = tmp_path / "log", tmp_path / "tidy"
    lines = ("import time, pathlib", IN_BLOCK + "try:", "        say('here'); time.sleep(60)", "    finally:")
    job = subprocess.Popen(
        script(*lines, f"        pathlib.Path({str(tidy)!r}).touch()", log=log), stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 60
    while not (log.exists() and log.read_text().endswith("here\n")):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    assert job_log.is_alive(job_log.read(log))
    job.send_signal(number)
    said = job.communicate()[1]
    told = job_log.read(log)
    assert (job.returncode, told.ending, told.reason) == (status, ending, reason)
    while job_log.is_alive(told):  # for a moment, where the job is another process than the script
        assert time.monotonic() < deadline
        time.sleep(0.01)
    assert tidy.exists() == bool(ending)  # what the job was writing is taken away
    assert said == (f"stiffdice: {log}: interrupted: told to stop (SIGTERM)\n" if number == signal.SIGTERM else "")


def test_no_room_for_the_log_does_not_stop_a_job(tmp_path):
    ended = run(IN_BLOCK + "say('simulation: 1.000 s'); print('made', flush=True)", log="/dev/full")
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "made\n", "")
    ended = run(IN_BLOCK + OURS, log="/dev/full")
    assert (ended.returncode, ended.stderr) == (2, "stiffdice: /dev/full: failed: x.h5: no room\n")


def test_a_log_that_cannot_be_opened_is_one_line(tmp_path):
    ended = run(IN_BLOCK + "print('made')", log=tmp_path)
    assert ended.returncode == 1
    assert (ended.stdout, ended.stderr) == ("", f"stiffdice: {tmp_path}: Is a directory\n")


def test_progress_is_told_by_tenths(tmp_path):
    log = tmp_path / "log"
    run(
        "from job import tenths",
        IN_BLOCK + "tell = tenths(say)",
        "    for k in range(1000): tell((k + 1) / 1000)",
        log=log,
    )
    assert log.read_text().splitlines()[2:-2] == [f"{k}0% done" for k in range(1, 11)]
    assert job_log.read(log).progress == 1


def test_a_process_of_its_own_is_named(tmp_path):
    log = tmp_path / "log"
    ended = run("import os", IN_BLOCK + "say(str(os.getpid()))", log=log)
    assert ended.returncode == 0
    assert str(job_log.read(log).process) == log.read_text().splitlines()[2] != str(os.getpid())
