"""What completes is what there is: asked of real shells."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tests.forks import run_module

from stiffdice.advice import engine_parameters
from stiffdice.cli import advise
from stiffdice.cli import main as cli
from stiffdice.cli.terminal import completion
from stiffdice.experiments.dice import response_table
from stiffdice.integrators.registry import SCHEMES
from stiffdice.scene.scene import PRESETS

ROOT = Path(__file__).parents[3]

# What readline does when a person types a line and presses the tabulator at its end.
ASK = r"""
source "$1"; cd "$2"; shift 2
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=()
_shtab_stiffdice 2>/dev/null
printf '%s\n' "${COMPREPLY[@]}"
"""


def test_every_placeholder_is_completed_or_is_free():
    for action in completion._actions(cli._parser()):
        if action.metavar is not None:
            how = completion.completion_of(str(action.metavar))
            assert (how is None) == (action.metavar in completion.FREE), action.metavar


def test_words_that_are_offered_are_those_that_are_allowed():
    words = completion._words()
    assert words["PURPOSE"] == list(advise.PURPOSES)
    assert words["ENGINE"] == list(engine_parameters.ENGINES)
    assert words["THROW"] == [table.throw for table in response_table.load(response_table.SHIPPED)]


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scripts")
    for shell in completion.SHELLS:
        done = run_module("stiffdice.cli", "completion", shell, cwd=folder)
        assert (done.returncode, done.stderr) == (0, "")
        (folder / shell).write_text(done.stdout)
    return folder


@pytest.fixture
def place(tmp_path):
    for name in ("my cube.yaml", "throw.h5", "model.xml", "notes.txt", "config/quick.yaml", "config/quiet.yaml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


@pytest.mark.long
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (["in"], {"infer", "inspect"}),
        (["run", ""], {"my cube.yaml", "config"}),
        (["run", "my"], {"my cube.yaml"}),
        (["inspect", ""], {"throw.h5", "config"}),
        (["check", "m"], {"model.xml"}),
        (["status", "qu"], {"quick", "quiet"}),
        (["archive", "qui"], {"quick", "quiet"}),
        (["run", "x.yaml", "--pre"], {"--preset"}),
        (["run", "x.yaml", "--preset", ""], set(PRESETS)),
        (["run", "x.yaml", "--scheme", ""], set(SCHEMES)),
        (["run", "x.yaml", "-o", "no"], {"notes.txt"}),
        (["run", "x.yaml", "--steps", ""], set()),
        (["completion", ""], set(completion.SHELLS)),
    ],
    ids=lambda given: " ".join(sorted(given) if isinstance(given, set) else given),
)
def test_bash_offers(scripts, place, typed, offered):
    words = [ASK, "bash", str(scripts / "bash"), str(place), "stiffdice", *typed]
    done = subprocess.run(["bash", "--norc", "-c", *words], capture_output=True, text=True, check=True)
    assert set(done.stdout.splitlines()) - {""} == offered


@pytest.mark.long
def test_zsh_takes_its_script(scripts):
    if shutil.which("zsh") is None:
        pytest.skip("zsh is not installed")
    subprocess.run(["zsh", "-n", str(scripts / "zsh")], check=True, capture_output=True)
    code = f"autoload -U compinit && compinit -u -D && source {scripts / 'zsh'} && whence -w _shtab_stiffdice"
    done = subprocess.run(["zsh", "-f", "-c", code], capture_output=True, text=True, check=True)
    assert "function" in done.stdout


@pytest.mark.long
def test_tcsh_is_offered_the_same_commands(scripts):
    text = (scripts / "tcsh").read_text()
    assert "complete stiffdice" in text
    assert all(name in text for name in cli.COMMANDS)


def test_help_does_not_import_it():
    code = "import sys; from stiffdice.cli import main; main._parser(); print({'shtab', 'numpy'} & {*sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
