"""Tables for people (Markdown) and for programs (CSV), from the same rows."""

from __future__ import annotations

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
    quoted = [",".join(_quoted(part) for part in row) for row in [columns, *texts]]
    return Table("\n".join(lines) + "\n", "\n".join(quoted) + "\n")


def _row(parts: Sequence[str]) -> str:
    return "| " + " | ".join(part.replace("|", "\\|") for part in parts) + " |"


def _quoted(part: str) -> str:
    """Return a field as RFC 4180 has it."""
    return '"' + part.replace('"', '""') + '"' if any(mark in part for mark in ',"\n') else part
