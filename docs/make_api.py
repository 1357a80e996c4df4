"""Write docs/reference/api.md from the docstrings of the public names: `make docs`."""

from __future__ import annotations

import dataclasses
import inspect
import re
import textwrap
from collections.abc import Iterable
from enum import Enum
from pathlib import Path
from typing import Any

import stiffdice

PAGE = Path(__file__).with_name("reference") / "api.md"
WIDTH = 100  # of a line of prose and of code

_INTRODUCTION = """\
# The Python API

`make docs` writes this page from the docstrings. `import stiffdice` loads nothing else until a name is used. The names
on this page, their parameters and their fields stay as they are within a minor version; other modules may change.
"""


def page() -> str:
    """Return the text of docs/reference/api.md."""
    parts = [_INTRODUCTION, stiffdice.__doc__ or "", "<!-- not run from here: signatures -->"]
    for name in stiffdice.__all__:
        parts += [f"## {name}", *_section(name, getattr(stiffdice, name))]
    return "\n\n".join(_reflowed(part) for part in parts) + "\n"


def _section(name: str, what: Any) -> list[str]:
    if not inspect.isclass(what):
        return [_code(_signature(name, what)), _listed(what, inspect.signature(what).parameters)]
    parts = [inspect.getdoc(what) or ""]
    if dataclasses.is_dataclass(what):
        fields = [f"    {field.name}: {field.type}{_default(field.default)}" for field in dataclasses.fields(what)]
        parts = [_code("\n".join([f"class {name}:", *fields])), _listed(what, what.__annotations__)]
    if issubclass(what, Exception):
        parts.insert(0, _code(f"class {name}({what.__bases__[0].__name__}): ..."))
    if issubclass(what, Enum):
        parts.append("\n\n".join(f"- {member.value} `{member.name}`" for member in what))
    for key, member in vars(what).items():
        if isinstance(member, property) and not key.startswith("_"):
            parts.append(f"`{name}.{key}`: {inspect.getdoc(member)}")
        elif inspect.isfunction(member) and not key.startswith("_"):
            parts += [_code(_signature(f"{name}.{key}", member)), inspect.getdoc(member) or ""]
    return parts


def _listed(what: Any, names: Iterable[str]) -> str:
    """Return a docstring with each of these names, where it is explained, at the head of a list's entry."""
    text = re.sub(r"(?<!\n)\n(?!\n)", " ", inspect.getdoc(what) or "")
    return re.sub(rf"(?:^|(?<=\. ))({'|'.join(names)})( \[[^]]*\])?: ", r"\n\n- `\1`\2: ", text, flags=re.MULTILINE)


def _signature(name: str, function: Any) -> str:
    """Return a function's signature, its annotations as they are written."""
    signature = inspect.signature(function)
    parts = []
    for parameter in signature.parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and "*" not in parts:
            parts.append("*")
        stars = "**" if parameter.kind is parameter.VAR_KEYWORD else ""
        if parameter.name != "self":
            parts.append(f"{stars}{parameter.name}: {parameter.annotation}{_default(parameter.default)}")
    line = f"{name}({', '.join(parts)}) -> {signature.return_annotation}"
    if len(line) <= WIDTH:
        return line
    return "\n".join([f"{name}(", *(f"    {part}," for part in parts), f") -> {signature.return_annotation}"])


def _default(value: object) -> str:
    if value in (inspect.Parameter.empty, dataclasses.MISSING):
        return ""
    return f' = "{value}"' if isinstance(value, str) else f" = {value!r}"  # in the quotes that ruff takes


def _code(text: str) -> str:
    return f"```python\n{text}\n```"


def _reflowed(text: str) -> str:
    """Return text with its paragraphs in lines of WIDTH, and its code as it is."""
    parts = re.split(r"(^```.*?^```$)", text.strip(), flags=re.MULTILINE | re.DOTALL)
    paragraphs = [
        part if part.startswith(("```", "#")) else _wrapped(part)
        for whole in parts
        for part in ([whole] if whole.startswith("```") else re.split(r"\n\s*\n", whole.strip()))
        if part
    ]
    return re.sub(r"^(- .*(?:\n  .*)*)\n\n(?=- )", r"\1\n", "\n\n".join(paragraphs), flags=re.MULTILINE)


def _wrapped(text: str) -> str:
    indent = "  " if text.startswith("- ") else ""
    words = " ".join(text.split())
    return textwrap.fill(words, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
