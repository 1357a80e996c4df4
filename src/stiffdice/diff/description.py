"""What a file says besides its values: variables, types, dimensions, attributes; and where two files differ in that."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import xarray as xr

from stiffdice.io.digest import Plain, plain, type_of

# What kinds of things two files may differ in. Numbers may be the same although attributes differ; not the others.
VARIABLE, TYPE, DIMENSIONS, ATTRIBUTE = "variable", "type", "dimensions", "attribute"

# (variable, kind, attribute's name) → what the files say; "" is no variable: the file itself.
Key = tuple[str, str, str]
Description = dict[Key, Plain]


@dataclass(frozen=True)
class Aspect:
    """What two files say of a variable (or, with an empty name, of themselves), None where one says nothing.

    what: `variable` (only one has it), `type`, `dimensions`, `attribute`; of the latter the name, with a key of it
    after a point where its text is a JSON object: `scene.ground.stiffness`.
    """

    variable: str
    what: str
    name: str
    a: Plain | None
    b: Plain | None


def describe(dataset: xr.Dataset, free: str = "") -> Description:
    """Return all that a dataset says besides its values.

    free: a dimension whose size does not count.
    """
    found: Description = {("", ATTRIBUTE, str(name)): plain(value) for name, value in dataset.attrs.items()}
    for key, variable in dataset.variables.items():
        name = str(key)
        found[name, TYPE, ""] = type_of(variable.dtype)
        found[name, DIMENSIONS, ""] = " × ".join(
            f"{dim}" if dim == free else f"{size} {dim}" for dim, size in variable.sizes.items()
        )
        for attribute, value in variable.attrs.items():
            found[name, ATTRIBUTE, str(attribute)] = plain(value)
    return found


def aspects(a: Description, b: Description) -> list[Aspect]:
    """Return where two descriptions differ, the file's own attributes first, then variable by variable."""
    names_a, names_b = ({key[0] for key in told} for told in (a, b))
    found = []
    for key in sorted(a.keys() | b.keys()):
        name, kind, attribute = key
        if name and (name in names_a) != (name in names_b):
            if kind == DIMENSIONS:
                found.append(Aspect(name, VARIABLE, "", a.get(key), b.get(key)))
        # By their texts: 1 is not 1.0 then, 0.0 not -0.0, and NaN is NaN.
        elif repr(a.get(key)) != repr(b.get(key)):
            found += _spread(name, kind, attribute, a.get(key), b.get(key))
    return found


def _spread(variable: str, kind: str, name: str, a: Plain | None, b: Plain | None) -> Iterator[Aspect]:
    """Yield a difference, or, of two JSON objects, one for each key in which they differ."""
    left, right = _leaves(a), _leaves(b)
    if left is None or right is None:
        yield Aspect(variable, kind, name, a, b)
        return
    differing = [key for key in left | right if repr(left.get(key)) != repr(right.get(key))]
    for key in differing:
        yield Aspect(variable, kind, f"{name}.{key}", left.get(key), right.get(key))
    if not differing:  # written otherwise
        yield Aspect(variable, kind, name, a, b)


def _leaves(text: Plain | None) -> dict[str, Plain] | None:
    """Return the values of a JSON object by their keys, joined with points; None if the text is none."""
    if not isinstance(text, str) or not text.startswith("{"):
        return None
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return dict(_flat(content, ""))


def _flat(content: Mapping[str, Any], above: str) -> Iterator[tuple[str, Plain]]:
    for key, value in content.items():
        if isinstance(value, dict) and value:
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", json.dumps(value) if isinstance(value, list | dict | bool | None) else value
