"""The tables of the pages on the file format, from `stiffdice.io.schema`: `make docs`."""

from __future__ import annotations

import re
from collections.abc import Mapping

from docs import markdown

from stiffdice.io import schema

# What else stands on these pages is written by hand.
PAGES = ("reference/FORMAT.md", "reference/FORMAT-runs.md", "reference/FORMAT-sweeps.md", "reference/FORMAT-timings.md")

_TABLE = r"\| {first} \|.*\n(?:\|.*\n)+"
_ATTRIBUTES = "| attribute | type |  | what |\n| -- | -- | -- | -- |\n"
_VARIABLES = "| variable | dimensions | type | unit |  | what |\n| -- | -- | -- | -- | -- | -- |\n"


def pages() -> dict[str, str]:
    """Return the texts of the pages, as they are but for their tables, which are those of the schema."""
    return {path: page((markdown.DOCS / path).read_text(encoding="utf-8")) for path in PAGES}


def page(text: str) -> str:
    """Return a page whose tables are those of the schema; text: the page as it is."""
    head, *sections = re.split(r"(?m)^(?=## )", text)
    return head + "".join(_section(section) for section in sections)


def _section(text: str) -> str:
    title = text.splitlines()[0].removeprefix("## ")
    kind = schema.Kind(schema.ATTRIBUTES, {}) if title == "In all files" else schema.KINDS.get(title)
    if kind is None:
        return text
    for first, table in (("attribute", _attributes(kind.attributes)), ("variable", _variables(kind.variables))):
        text = re.sub(_TABLE.format(first=first), lambda _, table=table: table, text)
    return text


def _attributes(attributes: Mapping[str, schema.Attribute]) -> str:
    rows = (f"| `{name}` | {part.type} | {part.need} | {part.what} |\n" for name, part in attributes.items())
    return _ATTRIBUTES + "".join(rows)


def _variables(variables: Mapping[str, schema.Variable]) -> str:
    rows = (
        f"| `{name}` | {', '.join(part.dimensions) or 'none'} | {part.type} | {part.units} | {_need(part)} | "
        f"{': '.join(filter(None, [part.role, part.long_name]))}{f'; {part.note}' if part.note else ''} |\n"
        for name, part in variables.items()
    )
    return _VARIABLES + "".join(rows)


def _need(part: schema.Variable) -> str:
    return part.need if part.since == "1.2" else f"{part.need} since {part.since}"
