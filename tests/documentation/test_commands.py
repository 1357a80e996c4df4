"""Every command of the documentation does what its page says: it runs, and prints what is shown."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from importlib.util import find_spec

import matplotlib as mpl
import pytest
from tests.documentation.checkout import Checkout
from tests.documentation.output import difference
from tests.documentation.pages import PAGES, ROOT, Block, blocks, commands, fences, lines, without_comment

from stiffdice.cli import main as cli

MAKEFILE = (ROOT / "Makefile").read_text()
TARGETS = set(re.findall(r"^([a-z-]+):", MAKEFILE, re.MULTILINE))
# Pages whose commands take less than a third of a second, and those whose studies take half a minute.
SHORT = [
    "docs/explanation/pair-engines.md",
    "docs/explanation/scale.md",
    "docs/how-to/archive.md",
]
BROAD = ["docs/explanation/granular.md", "docs/how-to/verify.md"]
# How a line begins that its reader types.
COMMAND = r"^(?:\$ |(?:\.venv/bin/)?(?:stiffdice|snakemake|python|make) [\w-])"


def held_to_what_there_is(words: list[str]) -> None:
    """Fail for an option, a target, a variable or a file that is not there."""
    program, *rest = words
    if program == "stiffdice" and "--version" not in rest:
        cli._parser().parse_args(rest)
    elif program == "make":
        for word in rest:
            name, given, _ = word.partition("=")
            if given:
                assert re.search(rf"\b{name}\b", MAKEFILE), word
            else:
                assert word in TARGETS or word.startswith("-"), word
    elif program == "python" and rest[:1] == ["-m"]:
        place = ROOT / rest[1].replace(".", "/")
        assert rest[1] in ("pytest", "venv", "pip", "json.tool") or place.is_dir() or place.with_suffix(".py").is_file()
    elif program == "python" and rest and rest[0].endswith(".py"):
        assert (ROOT / rest[0]).is_file(), rest[0]


@pytest.mark.parametrize("page", PAGES)
def test_commands_name_options_and_targets_that_there_are(page):
    for block in blocks(page):
        for script, _ in block.steps if block.language != "python" else []:
            for line in lines(script):
                for words in commands(line):
                    held_to_what_there_is(words)


@pytest.mark.parametrize("page", PAGES)
def test_commands_within_prose_name_options_and_targets_that_there_are(page):
    """They may be cut short: `stiffdice run --ledger`."""
    text = re.sub(
        r"<!--.*?-->|^( *)```.*?^\1```", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL
    )
    known = cli._parser()._subparsers._group_actions[0].choices
    for code in re.findall(r"`((?:\.venv/bin/)?(?:stiffdice|make) [a-z-][^`]*)`", text):
        program, *words = shlex.split(code.removeprefix(".venv/bin/"))
        if program == "make":
            held_to_what_there_is(["make", *words])
        elif not words[0].startswith("-"):
            options = known[words[0]]._option_string_actions
            assert {word.partition("=")[0] for word in words if word.startswith("--")} <= set(options), code


@pytest.mark.parametrize("page", PAGES)
def test_commands_are_in_blocks_that_say_so(page):
    """Those of another language, or of none, would not be run."""
    for line, language, content, _ in fences((ROOT / page).read_text(encoding="utf-8")):
        if language == "":
            assert not re.search(COMMAND, content, re.MULTILINE), f"{page}:{line}"
        elif language == "text":
            assert not re.search(r"^\$ ", content, re.MULTILINE), f"{page}:{line}"


@pytest.mark.parametrize("page", PAGES)
def test_what_is_left_out_is_there_and_has_its_reason(page):
    for block in blocks(page):
        for beginning in block.left_out:
            assert any(line.startswith(beginning) for script, _ in block.steps for line in script.splitlines()), block


def dry(line: str) -> str:
    """Return what is run in place of a line that is not: what it would do, if it can say that; else nothing."""
    found = re.match(r"(?:\.venv/bin/)?(make|snakemake) ", without_comment(line))
    quiet = " --quiet all" if found and found[1] == "snakemake" else ""
    return f"{found[0]}-n {without_comment(line)[found.end() :]}{quiet}" if found else ""


def not_run(block: Block) -> Iterator[str]:
    """Yield the lines of a block that are not run."""
    for script, _ in block.steps if block.language != "python" else []:
        yield from (line for line in lines(script) if block.not_run or line.startswith(block.left_out or "\0"))


def run(block: Block, checkout: Checkout) -> None:
    """Run a block; fail if it does not do what is shown."""
    for script in [*block.run_before, *filter(None, map(dry, not_run(block)))]:
        done = checkout.shell(script)
        assert done.status == 0, f"{block}: {script}: {done}"
    if block.not_run or (block.needs and find_spec(block.needs) is None):
        return
    for script, shown in block.steps:
        done = checkout.run(block, script)
        assert done.status == (block.status if script == block.steps[-1][0] else 0), f"{block}: {done}"
        if shown is not None and difference(shown, done.out + done.err):  # progress goes to the second
            assert not (differs := difference(shown, done.out)), f"{block}: {script}{differs}"


def timed(page: str) -> list[pytest.MarkDecorator]:
    """Return the marks that tell how long the commands of a page take."""
    return [pytest.mark.broad] if page in BROAD else [] if page in SHORT else [pytest.mark.long]


@pytest.mark.parametrize("page", [pytest.param(page, marks=timed(page)) for page in PAGES if blocks(page)])
def test_commands_run_and_print_what_is_shown(page, tmp_path):
    mpl.use("agg")
    checkout = Checkout(tmp_path)
    for block in blocks(page):
        run(block, checkout)
