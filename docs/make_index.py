"""The lists of pages in the index of each folder of docs/: `make docs`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fnmatch import fnmatch

from docs import markdown

FOLDERS = ("tutorial", "how-to", "explanation", "reference")

_LIST = re.compile(r"(?m)^- \[.*\n(?:  .*\n)*")
_CONTENTS = re.compile(r"(?ms)^(?=```\{toctree\}\n)")


def pages(written: Mapping[str, str]) -> dict[str, str]:
    """Return the texts of the index pages, as they are but for the list before each table of contents.

    A page that none names is added to the last. written: texts of pages that are written by code, which may not be
    stored yet.
    """
    there = {path.relative_to(markdown.DOCS).as_posix(): path.read_text() for path in markdown.DOCS.glob("*/*.md")}
    told = {}
    for folder in FOLDERS:
        texts = {path: text for path, text in (there | written).items() if re.fullmatch(rf"{folder}/[^/]+\.md", path)}
        head, *contents = _CONTENTS.split(_LIST.sub("", texts.pop(f"{folder}/index.md")))
        named = {path for part in contents for path in _named(part, sorted(texts))}
        contents[-1] = _with(contents[-1], sorted(texts.keys() - named))
        parts = [_tidy(head)]
        for part in contents:
            entries = "".join(f"{_entry(path, texts[path])}\n" for path in _named(part, sorted(texts)))
            parts.append("\n".join(filter(None, [entries, _tidy(part)])))
        told[f"{folder}/index.md"] = "\n".join(parts)
    return told


def _with(contents: str, paths: list[str]) -> str:
    """Return a table of contents that also names these pages, last."""
    names = "".join(f"{path.partition('/')[2].removesuffix('.md')}\n" for path in paths)
    return re.sub(r"(?m)^```\n", lambda end: names + end[0], contents, count=1)


def _tidy(text: str) -> str:
    return re.sub(r"\n{3,}", "\n\n", text).rstrip("\n") + "\n"


def _named(contents: str, paths: list[str]) -> list[str]:
    """Return the pages that a table of contents names, in its order."""
    patterns = [line for line in contents.partition("```\n")[0].splitlines()[1:] if line and not line.startswith(":")]
    found = [path for pattern in patterns for path in paths if fnmatch(path.partition("/")[2], f"{pattern}.md")]
    return list(dict.fromkeys(found))


def _entry(path: str, text: str) -> str:
    """Return the line of a list that leads to a page: its title and what it says that it is for, not for whom."""
    title, purpose = text.split("\n\n")[:2]
    plain = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", " ".join(purpose.split())).partition(" For whoever ")[0]
    return markdown.page(f"- [{title.removeprefix('# ')}]({path.partition('/')[2]}): {plain}").rstrip()
