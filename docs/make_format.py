"""Write the tables of docs/reference/FORMAT.md from `stiffdice.io.schema`: `make docs`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from stiffdice.io import schema

PAGE = Path(__file__).with_name("reference") / "FORMAT.md"

_TABLE = r"\| {first} \|.*\n(?:\|.*\n)+"
_ATTRIBUTES = "| attribute | type |  | what |\n| -- | -- | -- | -- |\n"
_VARIABLES = "| variable | dimensions | type | unit |  | what |\n| -- | -- | -- | -- | -- | -- |\n"


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


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
