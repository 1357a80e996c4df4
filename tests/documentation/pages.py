"""The pages of the documentation, and the commands that they show.

A fenced block `sh` or `python` may be followed by a block `text`: what it prints, on either stream. A block `console`
has both, each command behind `$ `. Comments right before a block, which nobody sees who reads the page, say more:

    <!-- not run: REASON -->               none of it is run, only held to the options, targets and rules that there are
    <!-- not run (make test, sudo): WHY -->   lines that begin so are not
    <!-- not run from here: REASON -->     nor is any block further down the page
    <!-- run before: COMMAND -->           what is to be there, made in a cheaper way than its reader would
    <!-- needs: mujoco -->                 it is run where that package can be imported
    <!-- exit status: 1 -->                of the last command, where it is not 0
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [
    *("README.md", "config/README.md", "results/README.md"),
    *sorted(str(path.relative_to(ROOT)) for path in ROOT.glob("docs/**/*.md")),
]
LANGUAGES = ("sh", "console", "python")
_MARK = re.compile(r"<!-- (not run from here|not run|run before|needs|exit status)(?: \((.*?)\))?: (.*?) -->")


@dataclass
class Block:
    """Commands of a page, one after another: scripts of a shell, or Python; of each what it shows of its output."""

    page: str
    line: int
    language: str
    steps: list[tuple[str, str | None]]
    not_run: str = ""
    needs: str = ""
    left_out: tuple[str, ...] = ()
    run_before: tuple[str, ...] = ()
    status: int = 0

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def fences(text: str) -> Iterator[tuple[int, str, str, str]]:
    """Yield line, language and content of every fenced block, and what is between it and the one before."""
    end = 0
    for found in re.finditer(r"^( *)```(\w*)[^\n]*\n(.*?)^\1```", text, re.MULTILINE | re.DOTALL):
        content = re.sub(rf"^{found[1]}", "", found[3], flags=re.MULTILINE)
        yield text.count("\n", 0, found.start()) + 1, found[2], content, text[end : found.start()]
        end = found.end()


def marks(before: str) -> list[tuple[str, str, str]]:
    """Return kind, beginnings and text of the comments that end the text before a block."""
    end = re.search(r"(?:<!--(?:(?!-->).)*-->\s*)*\Z", before, re.DOTALL)
    rest = re.findall(r"<!-- not run from here.*?-->", before, re.DOTALL)
    comments = rest or re.findall(r"<!--.*?-->", end[0] if end else "", re.DOTALL)
    found = [_MARK.fullmatch(" ".join(comment.split())) for comment in comments]
    return [(mark[1], mark[2] or "", mark[3]) for mark in found if mark]


def steps_of(language: str, content: str) -> list[tuple[str, str | None]]:
    """Return commands and what is shown of their output."""
    if language != "console":
        return [(content, None)]
    parts = re.split(r"^\$ ", content, flags=re.MULTILINE)[1:]
    return [(command + "\n", output or None) for command, _, output in (part.partition("\n") for part in parts)]


def blocks(page: str, text: str | None = None) -> list[Block]:
    """Return the blocks of a page that hold commands."""
    found: list[Block] = []
    last, rest = None, ""
    for line, language, content, before in fences(text or (ROOT / page).read_text(encoding="utf-8")):
        if language == "text" and last and not before.strip() and last.language != "console":
            last.steps[-1] = (last.steps[-1][0], content)
        last = None
        if language in LANGUAGES:
            last = Block(page, line, language, steps_of(language, content), not_run=rest)
            for kind, beginnings, told in marks(before):
                if kind == "run before":
                    last.run_before += (told,)
                elif kind == "needs":
                    last.needs = told
                elif kind == "exit status":
                    last.status = int(told)
                elif beginnings:
                    last.left_out += tuple(beginnings.split(", "))
                else:
                    last.not_run = told
                    rest = told if kind == "not run from here" else rest
            found.append(last)
    return found


def lines(script: str) -> list[str]:
    """Return the lines of a shell script: continued ones joined, without comments and what a here-document holds."""
    script = re.sub(r"<<-?\s*'?(\w+)'?(.*?)\n.*?^\1$", r"\2", script, flags=re.MULTILINE | re.DOTALL)
    joined = script.replace("\\\n", " ").splitlines()
    return [line.strip() for line in joined if line.strip() and not line.strip().startswith("#")]


def without_comment(line: str) -> str:
    """Return a line of a script without the comment that ends it."""
    return re.sub(r"\s+# .*", "", line)


def commands(line: str) -> Iterator[list[str]]:
    """Yield the words of each simple command of a line, without redirections, assignments and the folder of Python."""
    parser = shlex.shlex(line, posix=True, punctuation_chars=True)
    parser.whitespace_split = True
    words: list[str] = []
    tokens = [*parser, ";"]
    for before, token in zip(["", *tokens], tokens, strict=False):
        if set(token) <= set(";&|()"):
            if words:
                yield [words[0].removeprefix(".venv/bin/"), *words[1:]]
            words = []
            continue
        redirected = set(token) <= set("<>") or (before and set(before) <= set("<>"))
        if not redirected and (words or not re.fullmatch(r"[A-Z_]+=.*", token)):
            words.append(token)
