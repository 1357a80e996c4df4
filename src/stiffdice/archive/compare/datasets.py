"""What differs between two datasets, or two sets of shards: what they say besides values, and their values."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.archive.compare.values import Values, difference, located
from stiffdice.io.content_digest import CELL, Plain, plain, type_of


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
    unreadable: why files cannot be read. other: whether bytes differ that are no data. notes: what else is to say.
    """

    name: str
    values: tuple[Values, ...] = ()
    shapes: tuple[Aspect, ...] = ()
    attributes: tuple[Aspect, ...] = ()
    only_a: tuple[str, ...] = ()
    only_b: tuple[str, ...] = ()
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


def holds_runs(dataset: xr.Dataset) -> bool:
    """Return whether a dataset is a shard: runs in cells."""
    return "member" in dataset.sizes and all(
        name in dataset.variables and dataset[name].dims == ("cell",) for name in CELL
    )


def runs_difference(name: str, a: Sequence[xr.Dataset], b: Sequence[xr.Dataset]) -> Difference:
    """Return how the runs in two sets of shards differ, matched by contact law, stiffness and steps of their cells.

    Raises ValueError, of xarray, where the shards of one side do not hold the same variables.
    """
    if not (a and b):
        only = [tuple(_labels(_joined(part))) if part else () for part in (a, b)]
        return Difference(name, only_a=only[0], only_b=only[1])
    left, right = _joined(a), _joined(b)
    _, *shared = np.intersect1d(_keys(left), _keys(right), assume_unique=True, return_indices=True)
    found = datasets_difference(name, left.isel(cell=shared[0]), right.isel(cell=shared[1]))
    alone = [tuple(_labels(part.drop_isel(cell=at))) for part, at in zip((left, right), shared, strict=True)]
    return replace(found, only_a=alone[0], only_b=alone[1])


def _joined(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return all cells as one dataset, each once, in the order of their keys."""
    whole = xr.concat(
        parts, "cell", data_vars="minimal", coords="minimal", compat="override", combine_attrs="drop_conflicts"
    )
    return whole.isel(cell=np.unique(_keys(whole), return_index=True)[1])


def _keys(dataset: xr.Dataset) -> npt.NDArray[np.void]:
    return np.asarray(np.rec.fromarrays([dataset[name].values for name in CELL]))


def _labels(dataset: xr.Dataset) -> list[str]:
    return [located(dataset, ("cell",), (k,)) for k in range(dataset.sizes["cell"])]


def datasets_difference(name: str, a: xr.Dataset, b: xr.Dataset) -> Difference:
    """Return how two datasets differ."""
    left, right, notes = _shared(a, b)
    found = (
        difference(left[key], right[key], partial(located, left, tuple(map(str, left[key].dims))))
        for key in left.variables
    )
    # An attribute of a variable that one of them does not have says nothing new.
    both = [str(key) for key in a.variables.keys() & b.variables.keys()]
    shapes, attributes = (_aspects(of(a), of(b)) for of in (_shapes, lambda dataset: dict(_attributes(dataset, both))))
    return Difference(name, tuple(filter(None, found)), shapes, attributes, notes=notes)


def _aspects(a: Mapping[str, Plain], b: Mapping[str, Plain]) -> tuple[Aspect, ...]:
    # By their texts: 1 is not 1.0 then, 0.0 not -0.0, and NaN is NaN.
    names = [name for name in sorted(a.keys() | b.keys()) if repr(a.get(name)) != repr(b.get(name))]
    return tuple(Aspect(name, a.get(name), b.get(name)) for name in names)


def _shapes(dataset: xr.Dataset) -> dict[str, Plain]:
    return {
        str(name): ", ".join([type_of(variable.dtype), *(f"{size} {dim}" for dim, size in variable.sizes.items())])
        for name, variable in dataset.variables.items()
    }


def _attributes(dataset: xr.Dataset, variables: Sequence[str]) -> Iterator[tuple[str, Plain]]:
    """Yield the attributes of a dataset and of some variables by their names; JSON objects key by key."""
    for above, attributes in (("", dataset.attrs), *((f"{name}.", dataset[name].attrs) for name in variables)):
        for name, value in attributes.items():
            content = None
            if isinstance(value, str) and value.startswith("{"):
                with suppress(ValueError, RecursionError):
                    content = json.loads(value)
            yield from _leaves(f"{above}{name}", content) if content else [(f"{above}{name}", plain(value))]


def _leaves(name: str, content: Any) -> Iterator[tuple[str, Plain]]:
    if isinstance(content, dict) and content:
        for key, value in content.items():
            yield from _leaves(f"{name}.{key}", value)
    else:
        yield name, json.dumps(content)


def _shared(a: xr.Dataset, b: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset, tuple[str, ...]]:
    """Return of two datasets what can be compared value by value, and what is to say about the rest.

    These are the variables that both have along the same dimensions, at the labels that both have. Nothing is compared
    along dimensions of two sizes that have no labels.
    """
    shared = [name for name in a.variables if name in b.variables and a[name].dims == b[name].dims]
    left, right = (part.drop_vars([name for name in part.variables if name not in shared]) for part in (a, b))
    notes = []
    for dimension in [name for name in left.sizes if left.sizes[name] != right.sizes.get(name)]:
        if all(dimension in part.indexes and part.indexes[dimension].is_unique for part in (left, right)):
            left, right = xr.align(left, right, join="inner", exclude=set(left.sizes) - {dimension})
            notes.append(f"compared at the {left.sizes[dimension]} places along {dimension} that both have")
        else:
            left, right = (part.drop_dims([dimension]) for part in (left, right))
            notes.append(f"not compared along {dimension}: its sizes differ, and its places have no labels")
    return left, right, tuple(notes)
