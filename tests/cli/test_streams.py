"""Pipes, full disks and interrupts end a command in one line at most, never in a traceback."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCENE = str(ROOT / "config/scenes/figure-09.yaml")
COMMAND = [sys.executable, "-m", "stiffdice.cli"]


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    path = tmp_path_factory.mktemp("stored") / "a.h5"
    subprocess.run([*COMMAND, "run", SCENE, "--model", "sliding", "-q", "-o", path], check=True, capture_output=True)
    return str(path)


@pytest.mark.long
@pytest.mark.parametrize("words", [["inspect"], ["inspect", "--json"], ["verify"], ["--help"]], ids=" ".join)
def test_a_reader_that_goes_away_is_no_error(stored, words):
    given = words if words == ["--help"] else [words[0], stored, *words[1:], "-q"]
    ours, theirs = os.pipe()
    os.close(ours)  # nobody will read
    done = subprocess.run([*COMMAND, *given], stdout=theirs, stderr=subprocess.PIPE, check=False)
    os.close(theirs)
    assert done.stderr == b""
    assert done.returncode == 0


@pytest.mark.long
@pytest.mark.parametrize("closed", ["1", "2"])
def test_closed_streams_are_no_traceback(stored, closed):
    line = f'exec {closed}>&-; exec "$@"'
    done = subprocess.run(
        ["bash", "-c", line, "bash", *COMMAND, "inspect", stored, "-q"], capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.long
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_no_room_for_the_answer_is_one_line(stored):
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run([*COMMAND, "inspect", stored], stdout=full, stderr=subprocess.PIPE, check=False)
    assert (done.returncode, done.stderr) == (2, b"stiffdice: standard output: No space left on device\n")


@pytest.mark.long
def test_an_interrupt_is_one_line_and_status_130(tmp_path):
    words = ["run", SCENE, "--model", "sliding", "--steps", "1e10", "--every", "1e9", "-o", "a.h5"]
    child = subprocess.Popen([*COMMAND, *words], cwd=tmp_path, stderr=subprocess.PIPE, start_new_session=True)
    assert any(b"% done" in line for line in child.stderr), "it is at work"
    os.killpg(child.pid, signal.SIGINT)
    assert child.communicate(timeout=60)[1] == b"stiffdice: interrupted; nothing was stored\n"
    assert child.returncode == 130
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("columns", ["20", "60", "200"])
def test_help_fits_the_terminal_but_examples_are_kept(stiffdice, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", columns)
    out = stiffdice("plot", "--help")[1]
    assert "  stiffdice plot throw.h5 --draw energy -o energy.svg\n" in out
    prose = out.partition("animation\n\n")[2]
    assert prose
    assert max(map(len, prose.splitlines())) <= max(40, int(columns))
