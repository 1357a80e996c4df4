"""What --help shows as an example can be typed: in a fresh clone, after the lines before it."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest
from tests.forks import run_module

from stiffdice import __version__
from stiffdice.cli import main as cli

ROOT = Path(__file__).parents[2]
COMMANDS = [
    "",
    "run",
    "advise",
    "ground",
    "throw",
    "tosses",
    "infer",
    "new",
    "plot",
    "completion",
    "check",
    "inspect",
    "diff",
    "status",
    "archive",
    "verify",
    "rebuild",
]


def examples(command: str) -> list[list[str]]:
    """Return the words of every example of a command's help."""
    told = cli.COMMANDS[command].EXAMPLES if command else cli.EXAMPLES
    lines = told.split("\n\n")[0].splitlines()
    assert lines[0] == "examples:"
    return [shlex.split(line, comments=True) for line in lines[1:]]


def made_by(words: list[str]) -> set[str]:
    """Return the files and folders that a line leaves."""
    made = {words[k + 1] for k, word in enumerate(words) if word in ("-o", "--output", "--animate")}
    if words[0] == "cp":
        made.add(words[-1])
    if words[0] == "make":
        study = words[2].removeprefix("STUDY=")
        made.add(f"results/{study}")
        if words[1] == "archive":
            made.add(f"results/archives/{study}-{__version__}.crate.zip")
        if study == "quick":
            made |= {"results/quick/sweeps/steps-needed/sweep.h5"}
    return made


def named_by(words: list[str]) -> set[str]:
    """Return the files and folders that a line reads."""
    if words[0] == "make":
        return {f"config/{words[2].removeprefix('STUDY=')}.yaml"}
    given = words[1:] if words[0] == "cp" else words[2:]
    paths = {word for word in given if re.search(r"/|\.(yaml|h5|zip)$", word) and not re.search(r"[=' ]", word)}
    studies = given[:1] if words[0] == "stiffdice" and words[1] in ("status", "archive") else []
    return paths | {f"config/{study}.yaml" for study in studies}


def test_every_command_is_held_to_its_examples(capsys):
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    shown = re.findall(r"^    ([a-z]+)(?: |$)", capsys.readouterr().out, re.MULTILINE)
    assert sorted(shown) == sorted(COMMANDS[1:])


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command or "stiffdice")
def test_examples_name_what_is_there_and_options_that_are(command):
    there = set()
    for words in examples(command):
        there |= made_by(words)
        for path in named_by(words):
            assert path in there or (ROOT / path).is_file(), f"{shlex.join(words)}: {path}"
        if words[0] == "stiffdice":
            cli._parser().parse_args(words[1:])
        elif words[0] == "make":
            assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text(), re.MULTILINE), words
        else:
            assert words[0] == "cp"


@pytest.mark.long
@pytest.mark.parametrize(
    "command", ["run", pytest.param("advise", marks=pytest.mark.broad), "ground", "new", "plot", "completion"]
)
def test_examples_run(command, tmp_path):
    shutil.copytree(ROOT / "config", tmp_path / "config")
    for words in examples(command):
        done = run_module("stiffdice.cli", *words[1:], cwd=tmp_path)
        assert done.returncode == 0, f"{shlex.join(words)}: {done.stderr}{done.stdout}"
