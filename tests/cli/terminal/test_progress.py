from __future__ import annotations

import re
import time

import pytest

from stiffdice.cli.terminal import output, progress
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


def test_what_is_done_in_parts_says_how_long_it_will_take(clock, monkeypatch, capsys):
    monkeypatch.setattr(progress, "QUIET_SECONDS", 0.0)
    with progress.notes("verify: checking x") as tell:
        time.sleep(0.2)  # until the note has begun
        for clock[0], fraction in ((1.0, 0.0), (2.0, 0.25), (2.1, 0.3), (13.0, 0.5)):
            tell.part(fraction)
    told = capsys.readouterr().err
    assert "verify: checking x: 25.0% done, about 3 s left\n" in told
    assert "verify: checking x: 50.0% done, about 12 s left\n" in told
    assert "30.0%" not in told, "a line every ten seconds"


def test_what_is_tried_next_says_how_long_all_will_take_compiling_included(clock, monkeypatch, capsys):
    monkeypatch.setattr(progress, "QUIET_SECONDS", 0.0)
    with progress.trials("advise: trying") as tell:
        time.sleep(0.2)  # until the note has begun
        for clock[0], doing, fraction in ((1.0, "a pilot run", 0.0), (11.0, "event", 0.25), (12.0, "rk4", 0.5)):
            tell(doing, fraction)
            kernel_cache.TELLING.get()()
    said = capsys.readouterr().err.splitlines()
    assert said == [
        "advise: trying ...",
        "advise: trying a pilot run",
        "advise: trying a pilot run: compiling kernels, once",
        "advise: trying event: 25.0% done, about 30 s left",
        "advise: trying rk4: 50.0% done, about 11 s left",
    ]


@pytest.mark.parametrize("said", [progress.notes, progress.progress])
def test_quiet_leaves_progress_out(clock, monkeypatch, capsys, said):
    monkeypatch.setattr(progress, "QUIET_SECONDS", 0.0)
    before = output.QUIET.set(True)
    with said("x") as tell:
        time.sleep(0.1)
        for clock[0], fraction in ((1.0, 0.1), (20.0, 0.5)):
            (tell.part if said is progress.notes else tell)(fraction)
    output.QUIET.reset(before)
    assert capsys.readouterr().err == ""


def test_a_line_that_moves_fits_the_terminal(monkeypatch, capsys):
    monkeypatch.setattr(progress.sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "30")
    monkeypatch.setenv("TERM", "xterm")
    progress._Line().say("stiffdice: checking " + "a" * 100)
    assert capsys.readouterr().err == "\r\x1b[Kstiffdice: checking aaaaaaaaa"
