from __future__ import annotations

import os
import subprocess
import sys
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.io import host
from stiffdice.study import job_log


def read(path, *lines):
    path.write_text("".join(f"{line}\n" for line in lines))
    return job_log.read(path)


def test_what_is_written_is_read_back(tmp_path):
    told = read(tmp_path / "log", job_log.begun(), job_log.tenth(0.314), job_log.tenth(0.7), job_log.cells(12, 96))
    assert (told.process, told.host, told.progress, told.cells) == (os.getpid(), host.name(), 0.7, 12)
    assert abs(told.begun - datetime.now(UTC)) < timedelta(seconds=5)
    assert (told.ending, told.reason) == ("", "")
    assert job_log.is_alive(told)


@pytest.mark.parametrize(
    ("last", "ending", "reason"),
    [
        (job_log.done(12.34), "done", ""),
        (job_log.failed(InputError("a = 1: allowed is 2")), "failed", "a = 1: allowed is 2"),
        (job_log.failed(OSError("one\n  and two")), "failed", "a mistake in the program: OSError: one and two"),
        (job_log.failed(MemoryError()), "failed", "not enough memory"),
        (job_log.failed(OSError(24, "Too many open files", "x.h5")), "failed", "x.h5: Too many open files"),
        (job_log.failed(KeyError("k")), "failed", "a mistake in the program: KeyError: 'k'"),
        (job_log.interrupted("SIGTERM"), "interrupted", "told to stop (SIGTERM)"),
    ],
)
def test_every_ending_is_read_back(tmp_path, last, ending, reason):
    told = read(tmp_path / "log", job_log.begun(), last, "", "Traceback (most recent call last):")
    assert (told.ending, told.reason) == (ending, reason)


def test_a_numpy_array_that_does_not_fit_is_told_as_such():
    with pytest.raises(MemoryError) as caught:
        np.empty(1 << 60, np.uint8)
    assert job_log.reason_of(caught.value).startswith("not enough memory (Unable to allocate 1.00 EiB")


def test_a_process_that_has_ended_is_not_alive(tmp_path):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    told = read(tmp_path / "log", job_log.begun())._replace(process=ended.pid)
    os.waitid(os.P_PID, ended.pid, os.WEXITED | os.WNOWAIT)  # it has ended, and its number is still taken
    assert not job_log.is_alive(told)
    ended.wait()
    assert not job_log.is_alive(told)


def test_of_a_process_on_another_host_nothing_is_known(tmp_path):
    told = read(tmp_path / "log", f"begun 2026-01-01T00:00:00Z by process {os.getpid()} on elsewhere")
    assert job_log.is_alive(told) is None


def test_another_process_with_its_number_is_another_process(tmp_path):
    told = read(tmp_path / "log", f"begun 2001-01-01T00:00:00Z by process {os.getpid()} on {host.name()}")
    assert job_log.is_alive(told) is False


@pytest.mark.parametrize(
    "content",
    [b"", b"\xff\xfe\x00", b"begun 2026-13-41T99:00:00Z by process 1 on x\n", b"begun now\nfailed", b"999% of it\n"],
)
def test_a_log_that_is_none_of_ours_tells_nothing(tmp_path, content):
    (tmp_path / "log").write_bytes(content)
    told = job_log.read(tmp_path / "log")
    assert (told.begun, told.progress, told.cells, told.ending, told.empty) == (None, 0.0, None, "", content == b"")
    assert not job_log.is_alive(told)


def test_an_error_of_a_library_is_told_on_one_line():
    assert job_log.reason_of(OSError(2, "No such file", "a\x1b[2J\nb")) == r"a\x1b[2J\nb: No such file"
    assert job_log.reason_of(ValueError("a\x1b[2J\nb")) == r"a mistake in the program: ValueError: a\x1b[2J b"


def test_a_log_cannot_move_the_cursor(tmp_path):
    told = read(tmp_path / "log", "begun 2026-01-01T00:00:00Z by process 1 on \x1b[2J", "failed: \x1b[1A\x07gone")
    assert (told.host, told.reason) == (r"\x1b[2J", r"\x1b[1A\x07gone")


@pytest.mark.parametrize("make", [lambda path: None, lambda path: path.mkdir()])
def test_no_log_is_none(tmp_path, make):
    make(tmp_path / "log")
    assert job_log.read(tmp_path / "log") is None
