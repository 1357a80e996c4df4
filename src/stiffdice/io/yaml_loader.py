"""YAML as people write it: numbers like 1e4 are numbers, a key given twice is an error; and nothing but plain data."""

from __future__ import annotations

import re
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from stiffdice.errors import InputError
from stiffdice.io.text_file import text_of

LARGEST_FILE = 200_000  # bytes; a scene is under 1 kB, a study under 10 kB
MOST_NODES = 20_000  # numbers, words, lists and mappings, each counted wherever an alias repeats it
LONGEST_NUMBER = 1000  # digits

_INT, _FLOAT = "tag:yaml.org,2002:int", "tag:yaml.org,2002:float"

# NUL is in no name of a file, a surrogate in no UTF-8 text; YAML has escapes for both.
_NO_TEXT = re.compile("[\\0\\ud800-\\udfff]")


class _Loader(yaml.SafeLoader):
    """YAML 1.1 without its traps: `1.0e4` read as text, `010` as 8, `1:30` as 90, and repeated keys.

    Without tags, too: what a value is, it says itself. A date is text, and `<<` a key like any other.
    """

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise InputError(f"{_line(event)}: not valid YAML: tag {tag}: allowed are values without tags")
        return super().compose_node(parent, index)

    def get_single_node(self) -> yaml.Node | None:
        node = super().get_single_node()
        if node is not None:
            _check_size(node, {}, ())
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[str] = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, str):
                raise InputError(
                    f"{_line(key_node)}: a key must be a word; a decimal comma is written as a point, and a "
                    "number that is a key in quotes"
                )
            if key in seen:
                raise InputError(f"{_line(key_node)}: key {key} is given twice")
            seen.add(key)
        return super().construct_mapping(node, deep)


def _line(node: Any) -> str:
    return f"line {node.start_mark.line + 1}"


def _check_size(node: yaml.Node, sizes: dict[int, int], above: tuple[int, ...]) -> int:
    """Return how many nodes there are in one, aliases followed; raises InputError if too many, or without end.

    A few lines of aliases of aliases stand for more than any memory holds.
    """
    if id(node) in above:
        raise InputError(f"{_line(node)}: not valid YAML: holds itself")
    if id(node) not in sizes:
        if isinstance(node, yaml.ScalarNode):
            if node.tag == _INT and len(node.value) > LONGEST_NUMBER:
                raise InputError(f"{_line(node)}: a number of {len(node.value)} digits: allowed are {LONGEST_NUMBER}")
            if _NO_TEXT.search(node.value):
                raise InputError(f"{_line(node)}: {node.value}: allowed is text without NUL and surrogates")
            sizes[id(node)] = 1
        else:
            pairs = isinstance(node, yaml.MappingNode)
            inner = [part for pair in node.value for part in pair] if pairs else node.value
            sizes[id(node)] = 1 + sum(_check_size(part, sizes, (*above, id(node))) for part in inner)
    if sizes[id(node)] > MOST_NODES:
        raise InputError(f"{_line(node)}: more than {MOST_NODES} values; this is no scene or study")
    return sizes[id(node)]


_NOT_READ = tuple(f"tag:yaml.org,2002:{kind}" for kind in ("timestamp", "value", "merge"))
_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in (_INT, _FLOAT, *_NOT_READ)]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_NUMBER_STARTS = list("-+.0123456789")
_Loader.add_implicit_resolver(_INT, re.compile(r"^[-+]?(0|[1-9][0-9]*)$"), _NUMBER_STARTS)
_Loader.add_implicit_resolver(
    _FLOAT,
    re.compile(
        r"^[-+]?((0|[1-9][0-9]*)?\.[0-9]+|(0|[1-9][0-9]*)\.|(0|[1-9][0-9]*)(?=[eE]))([eE][-+]?[0-9]+)?$"
        r"|^[-+]?\.(inf|Inf|INF)$|^\.(nan|NaN|NAN)$"
    ),
    _NUMBER_STARTS,
)


def parse(text: str) -> Any:
    """Return what `text` says; raises InputError with the line where it is not YAML."""
    try:
        # _Loader is a SafeLoader: it makes plain data, never objects.
        return yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        line = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise InputError(f"{line}not valid YAML: {error.problem}") from None
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise InputError(f"not valid YAML: {str(error).splitlines()[0]}") from None


def load(path: str | Path) -> Any:
    """Return what the file says; raises InputError if it cannot be read or is not YAML."""
    text = text_of(path, LARGEST_FILE)
    try:
        return parse(text)
    except InputError as error:
        raise error.within(str(path)) from None
