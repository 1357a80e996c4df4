"""Colours are for terminals, and for whoever asks for them."""

from __future__ import annotations

import os
import pty
import subprocess
import sys

import pytest

from stiffdice.cli.terminal import output

PLAIN = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "FORCE_COLOR")} | {"TERM": "xterm"}
CODE = """
from stiffdice.cli.terminal import output
from stiffdice.simulation.outcome import Verdict
output.say_verdict(["a.h5: " + Verdict.PASSED.sentence], "a.h5", Verdict.PASSED)
output.say_verdict(["b.h5: " + Verdict.SANK.sentence], "b.h5", Verdict.SANK)
output.say("FAILS: c.h5: its seal is broken\\nfiles: 3")
output.note(["steep"])
"""
PASSED = b"a.h5: \x1b[32mpassed\x1b[0m: every criterion"
SANK = b"b.h5: \x1b[31msank or tunnelled\x1b[0m: the whole"


def shown(environment: dict[str, str], *, terminal: bool) -> bytes:
    """Return what is seen of both streams, by a person or by a pipe."""
    command = [sys.executable, "-c", CODE]
    if not terminal:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=environment, check=True)
        return done.stdout
    ours, theirs = pty.openpty()
    with subprocess.Popen(command, stdout=theirs, stderr=theirs, env=environment) as child:
        os.close(theirs)
        seen = b""
        while True:
            try:
                part = os.read(ours, 4096)
            except OSError:  # the other end is closed
                break
            if not part:
                break
            seen += part
    os.close(ours)
    assert child.returncode == 0
    return seen


@pytest.mark.parametrize(
    ("told", "terminal", "coloured"),
    [
        ({}, True, True),
        ({}, False, False),
        ({"NO_COLOR": "1"}, True, False),
        ({"NO_COLOR": ""}, True, True),
        ({"FORCE_COLOR": "1"}, False, True),
        ({"NO_COLOR": "1", "FORCE_COLOR": "1"}, False, False),
        ({"TERM": "dumb"}, True, False),
    ],
)
@pytest.mark.long
def test_colours_go_to_terminals_unless_told_otherwise(told, terminal, coloured):
    seen = shown(PLAIN | told, terminal=terminal)
    assert (b"\x1b" in seen) == coloured
    if coloured:
        assert PASSED in seen
        assert SANK in seen
        assert b"\x1b[31mFAILS\x1b[0m: c.h5" in seen
        assert b"stiffdice: \x1b[33mnote\x1b[0m: steep" in seen


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("the same, byte for byte: 1 file", "the same,"),
        ("different: values in 1 file", "different"),
        ("nothing fails; not checked: digests", "nothing fails"),
        ("2 files must not be trusted", "must not be trusted"),
        ("  verdict    fine", "fine"),
        ("ball.xml: nothing wrong; timestep 0.002 s", "nothing wrong"),
        ("ball.xml: 1 of 2 contacts with something wrong; timestep 0.004 s", "1 of 2 contacts with something wrong"),
        ("DIFFERS, between the archive (A) and what was made again (B):", "DIFFERS"),
        ("a file that passed: long ago", None),
        ("energy    1, allowed 1.05", None),
    ],
)
def test_the_words_of_a_verdict_are_coloured_and_no_others(monkeypatch, capsys, line, word):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("FORCE_COLOR", "1")
    output.say(line)
    seen = capsys.readouterr().out.rstrip("\n")
    assert seen.replace("\x1b[0m", "").replace("\x1b[31m", "").replace("\x1b[32m", "") == line
    found = None if "\x1b" not in seen else seen.partition("m")[2].partition("\x1b")[0] if seen[0] == "\x1b" else word
    assert found == word
