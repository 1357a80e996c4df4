"""Markdown as the generated pages have it: prose in lines of WIDTH, tables, code."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path

DOCS = Path(__file__).parent
WIDTH = 100  # of a line of prose and of code


def code(text: str, language: str = "python") -> str:
    """Return a block of code."""
    return f"```{language}\n{text}\n```"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; cells may hold `|`."""
    lines = [head, ["--"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines)


def page(*parts: str) -> str:
    """Return the text of a page: its parts, with their paragraphs in lines of WIDTH, and their code as it is."""
    return "\n\n".join(_reflowed(part) for part in parts if part) + "\n"


def _reflowed(text: str) -> str:
    parts = re.split(r"(^```.*?^```$)", text.strip(), flags=re.MULTILINE | re.DOTALL)
    paragraphs = [
        part if part.startswith(("```", "#", "|")) else _wrapped(part)
        for whole in parts
        for part in ([whole] if whole.startswith("```") else re.split(r"\n\s*\n", whole.strip()))
        if part
    ]
    return re.sub(r"^(- .*(?:\n  .*)*)\n\n(?=- )", r"\1\n", "\n\n".join(paragraphs), flags=re.MULTILINE)


def _wrapped(text: str) -> str:
    indent = "  " if text.startswith("- ") else ""
    words = " ".join(text.split())
    return textwrap.fill(words, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
