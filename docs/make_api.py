"""The pages of the public names, from their docstrings: `make docs`."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterable
from enum import Enum
from typing import Any

from docs import markdown

import stiffdice

# By page: its title, what it is for, and the names on it.
_PAGES = {
    "scenes": (
        "Python: scenes",
        "Scenes of one cube and of two, from files and from plain data. For whoever gives Python a problem.",
        ("Scene", "load_scene", "scene_from_mapping", "PairScene", "load_pair_scene", "pair_scene_from_mapping"),
    ),
    "runs": (
        "Python: runs",
        "Running one scene, and what a run holds. For whoever simulates from Python.",
        ("simulate", "Run", "Trajectory"),
    ),
    "pair": (
        "Python: two cubes",
        "Running a scene of two cubes, and what such a run holds. For whoever simulates from Python.",
        ("simulate_pair", "PairRun", "PairTrajectory", "pair_dataset"),
    ),
    "dice": (
        "Python: dice",
        "Throwing a die many times, until its faces are decided. For whoever counts faces from Python.",
        ("LaunchDistribution", "land", "Landing", "Rest"),
    ),
    "advice": (
        "Python: advice",
        "Which scheme and how many steps keep an error. For whoever chooses them from Python.",
        ("advise", "Advice", "Option", "run_advised"),
    ),
    "files": (
        "Python: verdicts, files, errors",
        "What a run ended with, files and datasets, and errors. For whoever stores or reads results from Python.",
        ("Verdict", "run_dataset", "write_dataset", "open_results", "StiffdiceError", "InputError", "OutputError"),
    ),
}

_INTRODUCTION = """\
# The Python API

What `import stiffdice` offers, with an example. For whoever works in a notebook or writes a program.

`make docs` writes these pages from the docstrings. `import stiffdice` loads nothing else until a name is used. The
names on these pages, their parameters and their fields stay as they are within a minor version; other modules may
change.
"""

_SIGNATURES = "<!-- not run from here: signatures -->"  # for the test that runs what pages show


def pages() -> dict[str, str]:
    """Return the texts of docs/reference/api.md and of docs/reference/api/*.md."""
    links = [
        (f"[{title}](api/{name}.md)", " ".join(f"`{each}`" for each in names))
        for name, (title, _, names) in _PAGES.items()
    ]
    table = markdown.table(("page", "names"), links)
    told = {"reference/api.md": markdown.page(_INTRODUCTION, table, stiffdice.__doc__ or "")}
    for name, (title, purpose, names) in _PAGES.items():
        sections = (part for each in names for part in (f"## {each}", *_section(each, getattr(stiffdice, each))))
        told[f"reference/api/{name}.md"] = markdown.page(
            f"# {title}", purpose, "<!-- not run from here: signatures -->", *sections
        )
    return told


def _section(name: str, what: Any) -> list[str]:
    if not inspect.isclass(what):
        return [markdown.code(_signature(name, what)), _listed(what, inspect.signature(what).parameters)]
    parts = [inspect.getdoc(what) or ""]
    if dataclasses.is_dataclass(what):
        fields = [f"    {field.name}: {field.type}{_default(field.default)}" for field in dataclasses.fields(what)]
        parts = [markdown.code("\n".join([f"class {name}:", *fields])), _listed(what, what.__annotations__)]
    if issubclass(what, Exception):
        parts.insert(0, markdown.code(f"class {name}({what.__bases__[0].__name__}): ..."))
    if issubclass(what, Enum):
        parts.append("\n\n".join(f"- {member.value} `{member.name}`" for member in what))
    for key, member in vars(what).items():
        if isinstance(member, property) and not key.startswith("_"):
            parts.append(f"`{name}.{key}`: {inspect.getdoc(member)}")
        elif inspect.isfunction(member) and not key.startswith("_"):
            parts += [markdown.code(_signature(f"{name}.{key}", member)), inspect.getdoc(member) or ""]
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
    if len(line) <= markdown.WIDTH:
        return line
    return "\n".join([f"{name}(", *(f"    {part}," for part in parts), f") -> {signature.return_annotation}"])


def _default(value: object) -> str:
    if value in (inspect.Parameter.empty, dataclasses.MISSING):
        return ""
    return f' = "{value}"' if isinstance(value, str) else f" = {value!r}"  # in the quotes that ruff takes
