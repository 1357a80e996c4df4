"""Two datasets: what they say besides values, and their values."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import xarray as xr

from stiffdice.archive.compare.values import Values, difference, located
from stiffdice.io.content_digest import Plain, plain, type_of


@dataclass(frozen=True)
class Aspect:
    """What two files say otherwise besides values; None where one says nothing.

    name: of a variable, whose type and sizes are told, or of an attribute: `title`, `position.units`, and, where the
    attribute is a JSON object, of a key of it: `scene.ground.stiffness`.
    """

    name: str
    a: Plain | None
    b: Plain | None


@dataclass(frozen=True)
class Difference:
    """How two files (or all shards of a sweep) of one name differ.

    values: in which variables. shapes, attributes: in what they say besides values. only_a, only_b: cells that one has.
    line: of text that differs, its number and both texts. unreadable: why files cannot be read. other: whether bytes
    differ that are no data. notes: what else is to say.
    """

    name: str
    values: tuple[Values, ...] = ()
    shapes: tuple[Aspect, ...] = ()
    attributes: tuple[Aspect, ...] = ()
    only_a: tuple[str, ...] = ()
    only_b: tuple[str, ...] = ()
    line: tuple[int, str, str] | None = None
    unreadable: tuple[str, ...] = ()
    other: bool = False
    notes: tuple[str, ...] = ()

    @property
    def numbers(self) -> bool:
        """Whether values, or what is there of them, differ; not only attributes or other files' bytes."""
        return bool(self.values or self.shapes or self.unreadable or self.only_a or self.only_b)

    @property
    def same(self) -> bool:
        """Whether both say the same."""
        return not (self.numbers or self.attributes or self.other)


def datasets_difference(name: str, a: xr.Dataset, b: xr.Dataset) -> Difference:
    """Return how two datasets differ."""
    left, right, notes = _overlap(a, b)
    found = (
        difference(left[key], right[key], partial(located, left, tuple(map(str, left[key].dims))))
        for key in left.variables
    )
    values = tuple(variable for variable in found if variable)
    # An attribute of a variable that one of them does not have says nothing new.
    alone = {str(key) for key in a.variables.keys() ^ b.variables.keys()}
    said = [{key: text for key, text in _attributes(part).items() if key.split(".")[0] not in alone} for part in (a, b)]
    return Difference(name, values, _aspects(_shapes(a), _shapes(b)), _aspects(*said), notes=notes)


def _aspects(a: Mapping[str, Plain], b: Mapping[str, Plain]) -> tuple[Aspect, ...]:
    # By their texts: 1 is not 1.0 then, 0.0 not -0.0, and NaN is NaN.
    names = [name for name in sorted(a.keys() | b.keys()) if repr(a.get(name)) != repr(b.get(name))]
    return tuple(Aspect(name, a.get(name), b.get(name)) for name in names)


def _shapes(dataset: xr.Dataset) -> dict[str, Plain]:
    return {
        str(name): ", ".join([type_of(variable.dtype), *(f"{size} {dim}" for dim, size in variable.sizes.items())])
        for name, variable in dataset.variables.items()
    }


def _attributes(dataset: xr.Dataset) -> dict[str, Plain]:
    found: dict[str, Plain] = {}
    for above, attributes in (("", dataset.attrs), *((f"{name}.", dataset[name].attrs) for name in dataset.variables)):
        for name, value in attributes.items():
            found |= _flat(f"{above}{name}", plain(value))
    return found


def _flat(name: str, value: Plain) -> dict[str, Plain]:
    """Return an attribute by its name; a JSON object key by key."""
    try:
        content = json.loads(value) if isinstance(value, str) and value.startswith("{") else None
    except (ValueError, RecursionError):
        content = None
    return dict(_leaves(name, content)) if isinstance(content, dict) else {name: value}


def _leaves(name: str, content: Mapping[str, Any]) -> Iterator[tuple[str, Plain]]:
    for key, value in content.items():
        if isinstance(value, dict) and value:
            yield from _leaves(f"{name}.{key}", value)
        else:
            yield f"{name}.{key}", json.dumps(value)


def _overlap(a: xr.Dataset, b: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset, tuple[str, ...]]:
    """Return of two datasets what can be compared value by value, and what is to say about the rest.

    These are the variables that both have along the same dimensions. Where one goes on longer, its beginning is taken,
    if the labels there are the same; what lies along other dimensions of two sizes is left out.
    """
    shared = [name for name in a.variables if name in b.variables and a[name].dims == b[name].dims]
    left, right = (part.drop_vars([name for name in part.variables if name not in shared]) for part in (a, b))
    notes = []
    for dimension in [name for name in left.sizes if left.sizes[name] != right.sizes[name]]:
        size = min(left.sizes[dimension], right.sizes[dimension])
        one, other = (part.isel({dimension: slice(size)}) for part in (left, right))
        if all(one[name].equals(other[name]) for name in left.coords if left[name].dims == (dimension,)):
            left, right = one, other
            notes.append(f"compared up to {dimension} {size}, where the shorter ends")
        else:
            along = [name for name in left.variables if dimension in left[name].dims]
            left, right = left.drop_vars(along), right.drop_vars(along)
            notes.append(f"not compared along {dimension}: its places are others")
    return left, right, tuple(notes)
