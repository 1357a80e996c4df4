"""Tables for people (Markdown) and for programs (CSV), from the same rows."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import NamedTuple


class Table(NamedTuple):
    """One table, twice."""

    markdown: str
    csv: str


def rendered(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]], note: str = "") -> Table:
    """Return a table with a title, a heading for each column, rows as long as it, and a note under the Markdown."""
    texts = [[str(part) for part in row] for row in rows]
    lines = [f"# {title}", "", _row(columns), _row(["---"] * len(columns)), *map(_row, texts)]
    if note:
        lines += ["", note]
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows([columns, *texts])
    return Table("\n".join(lines) + "\n", stream.getvalue())


def _row(parts: Sequence[str]) -> str:
    return "| " + " | ".join(part.replace("|", "\\|") for part in parts) + " |"


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of one length as indented lines, their columns below each other."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  " + "  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
