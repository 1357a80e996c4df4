"""The same option is the same in every command, and every command says what it prints in the same ways."""

from __future__ import annotations

import argparse
import json
import re
from collections import defaultdict
from pathlib import Path

import pytest

from stiffdice.cli import grammar
from stiffdice.cli import main as cli

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config"
MEANT_FOR_PROGRAMS = set(cli.COMMANDS) - {"new", "completion"}


def parsers() -> dict[str, argparse.ArgumentParser]:
    (commands,) = (part for part in cli._parser()._actions if isinstance(part, argparse._SubParsersAction))
    return commands.choices


def options(parser: argparse.ArgumentParser) -> dict[str, argparse.Action]:
    return {action.option_strings[-1]: action for action in parser._actions if action.option_strings}


def test_an_option_of_several_commands_is_the_same_in_all():
    found = defaultdict(list)
    for parser in parsers().values():
        for name, action in options(parser).items():
            found[name].append(action)
    shared = {name: actions for name, actions in found.items() if len(actions) > 1 and name != "--help"}
    assert set(shared) == set(grammar.OPTIONS)
    for name, actions in shared.items():
        option = grammar.OPTIONS[name]
        for action in actions:
            assert tuple(action.option_strings) == option.names
            assert action.metavar == option.metavar
            assert action.help.startswith(option.told)


def test_every_argument_says_what_it_is():
    assert all(action.help for parser in parsers().values() for action in parser._actions)


def test_placeholders_say_what_they_stand_for():
    for name, parser in parsers().items():
        for action in parser._actions:
            told = action.metavar if action.nargs != 0 else "SWITCH"
            assert told and re.match(r"[A-Z]", told), (name, action.dest)


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_what_prints_results_has_json_and_quiet_at_its_end(command):
    names = list(options(parsers()[command]))
    at_end = [name for name in names if name in ("--json", "--quiet")]
    assert at_end == (["--json", "--quiet"] if command in MEANT_FOR_PROGRAMS else [])


def strict(text: str) -> dict[str, object]:
    def refuse(word: str) -> None:
        raise AssertionError(word)

    found = json.loads(text, parse_constant=refuse)
    assert isinstance(found, dict)
    return found


SCENE, PAIR = CONFIG / "scenes" / "figure-09.yaml", CONFIG / "scenes" / "two-cubes.yaml"
DIE = ("--mass", "4 g", "--side", "16 mm", "--speed", "2", "--depth", "0.1 mm", "--quick")
# A number with a dimension has its unit at the end of its key, unless it stands in a scene or in a file's attributes.
BARE = re.compile("time|duration|step_size|mass|side|radius|stiffness|damping|depth|speed|velocity|position|gravity")


def keys(data: object, above: str = "") -> set[str]:
    if above in ("scene", "ground", "attributes", "parameters", "variables", "sizes"):
        return set()
    if isinstance(data, dict):
        return set(data) | {key for name, part in data.items() for key in keys(part, name)}
    return {key for part in data for key in keys(part)} if isinstance(data, list) else set()


@pytest.mark.parametrize(
    "words",
    [
        ("run", SCENE, "--model", "sliding", "--steps", "100", "-o", "a.h5"),
        ("ground", "--restitution", "0.5", *DIE),
        ("ground", "--material"),
        ("infer", CONFIG / "measurements" / "labby-2009.yaml", "--response", CONFIG / "nothing.h5"),
        pytest.param(("inspect", "a.h5"), marks=pytest.mark.long),
        pytest.param(("plot", "a.h5"), marks=pytest.mark.long),
        pytest.param(("diff", "a.h5", "a.h5"), marks=pytest.mark.long),
        pytest.param(("verify", "a.h5"), marks=pytest.mark.long),
        pytest.param(("throw", "--count", "2"), marks=pytest.mark.long),
        pytest.param(
            ("run", CONFIG / "scenes" / "two-cubes.yaml", "--steps", "100", "-o", "b.h5"), marks=pytest.mark.long
        ),
        pytest.param(("advise", SCENE, "--scheme", "symplectic_euler", "--horizon", "0.5"), marks=pytest.mark.long),
        pytest.param(("tosses", CONFIG / "measurements" / "tosses.h5"), marks=pytest.mark.broad),
    ],
    ids=lambda words: words[0],
)
def test_json_is_one_object_alone_with_units_in_its_keys(stiffdice, words):
    if "a.h5" in words and words[0] != "run":
        stiffdice("run", SCENE, "--model", "sliding", "--steps", "100", "-o", "a.h5", "--quiet")
    status, out, err, _ = stiffdice(*words, "--json", "--quiet")
    if words[0] == "infer":  # what cannot be answered is an error line alone
        assert (status, out, err.count("\n")) == (2, "", 1)
        return
    assert (status, err) == (0, "")
    assert not [key for key in keys(strict(out)) if BARE.fullmatch(key)]


def test_a_run_says_its_verdict_to_programs(stiffdice):
    found = strict(stiffdice("run", SCENE, "--model", "sliding", "-o", "a.h5", "--json")[1])
    assert (found["file"], found["passed"], found["verdict"]) == ("a.h5", False, "energy_grew")
    assert found["criteria"]["energy"]["value"] > found["criteria"]["energy"]["limit"] == 1.05
    assert (found["steps"], found["step_size_s"]) == (10_000, 0.001)


def test_quiet_leaves_out_notes_and_nothing_else(stiffdice):
    words = ("run", SCENE, "--model", "sliding", "-o", "a.h5")
    loud, quiet = stiffdice(*words), stiffdice(*words, "-q")
    assert loud[2].startswith("stiffdice: note: ")
    assert (quiet[0], quiet[1], quiet[2]) == (0, loud[1], "")
    assert (
        stiffdice("run", "nowhere.yaml", "-o", "a.h5", "-q")[2]
        == "stiffdice: nowhere.yaml: No such file or directory\n"
    )
