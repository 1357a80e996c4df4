from __future__ import annotations

import re
import time

import pytest

from stiffdice.cli.terminal import progress
from stiffdice.dynamics.compiling import kernel_cache


@pytest.fixture
def clock(monkeypatch):
    """A clock that a test sets."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def told(clock, capsys, moments):
    with progress.progress() as show:
        for clock[0], fraction in moments:
            show(fraction)
    return capsys.readouterr().err


def test_a_short_run_says_nothing(clock, capsys):
    assert told(clock, capsys, [(0.5, 0.2), (1.0, 0.5), (1.9, 0.99), (2.5, 1.0)]) == ""


def test_a_long_run_says_how_long_it_will_take(clock, capsys):
    # Five seconds to compile and do the first hundredth, then a hundredth a second.
    said = told(clock, capsys, [(5.0, 0.01), (25.0, 0.21), (26.0, 0.22), (45.0, 0.41)])
    assert re.findall(r"([\d.]+)% done, about (\d+) s left", said) == [("21.0", "79"), ("41.0", "59")]


@pytest.mark.parametrize(("quiet", "told"), [(0.0, "stiffdice: planning the sweeps of x ...\n"), (60.0, "")])
def test_what_takes_long_is_said_once(monkeypatch, capsys, quiet, told):
    monkeypatch.setattr(progress, "QUIET_SECONDS", quiet)
    with progress.notes("stiffdice: planning the sweeps of x"):
        time.sleep(0.2)
    assert capsys.readouterr().err == told


def test_compiling_is_said_once(capsys):
    with progress.progress("event"):
        tell = kernel_cache.TELLING.get()
        tell(), tell()
    assert capsys.readouterr().err == "compiling the kernels of event, once; about 12 s\n"
    assert kernel_cache.TELLING.get() is None
