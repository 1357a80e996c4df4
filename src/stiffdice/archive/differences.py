"""What differs between two datasets, or two sets of shards: what they say besides values, and their values."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.content_digest import CELL, Plain, plain, type_of

Index = tuple[int, ...]


@dataclass(frozen=True)
class Place:
    """One value that differs: where it is, such as `first at time = 2 s, axis z`; both values, exactly."""

    where: str
    a: str
    b: str


@dataclass(frozen=True)
class Values:
    """How the values of one variable differ.

    count: how many of `of`. places: the first, and the one of the largest difference. unmeasured: those of which one is
    NaN or infinite. Of the others the largest difference in ulp [1], relative [1] to the larger of the two magnitudes,
    and absolute [units]; of whole numbers the last alone, of enums none. changes: of an enum, how many changed from
    which word to which.
    """

    variable: str
    units: str
    of: int
    count: int
    places: tuple[Place, ...]
    unmeasured: int = 0
    ulp: int | None = None
    relative: float | None = None
    absolute: float | None = None
    changes: tuple[str, ...] = ()


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


def data_difference(name: str, a: Sequence[xr.Dataset], b: Sequence[xr.Dataset]) -> Difference:
    """Return how two sets of shards differ, cell by cell of one contact law, stiffness and steps; or how two files do.

    Raises ValueError, of xarray, where the shards of one side do not hold the same variables.
    """
    if not all(map(holds_runs, [*a, *b])):
        return datasets_difference(name, a[0], b[0])
    if not (a and b):
        return Difference(name, only_a=_labels(_joined(a)) if a else (), only_b=_labels(_joined(b)) if b else ())
    left, right = _joined(a), _joined(b)
    _, at, there = np.intersect1d(_keys(left), _keys(right), assume_unique=True, return_indices=True)
    found = datasets_difference(name, left.isel(cell=at), right.isel(cell=there))
    return replace(found, only_a=_labels(left.drop_isel(cell=at)), only_b=_labels(right.drop_isel(cell=there)))


def _joined(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return all cells as one dataset, each once, in the order of their keys."""
    whole = xr.concat(
        parts, "cell", data_vars="minimal", coords="minimal", compat="override", combine_attrs="drop_conflicts"
    )
    return whole.isel(cell=np.unique(_keys(whole), return_index=True)[1])


def _keys(dataset: xr.Dataset) -> npt.NDArray[np.void]:
    return np.asarray(np.rec.fromarrays([dataset[name].values for name in CELL]))


def _labels(dataset: xr.Dataset) -> tuple[str, ...]:
    return tuple(_located(dataset, ("cell",), (k,)) for k in range(dataset.sizes["cell"]))


def datasets_difference(name: str, a: xr.Dataset, b: xr.Dataset) -> Difference:
    """Return how two datasets differ."""
    left, right, notes = _shared(a, b)
    common = [(left[key], right[key]) for key in left.variables]
    found = (values_difference(one, other, partial(_located, left, one.dims)) for one, other in common)
    shapes = [
        {
            str(key): ", ".join([type_of(variable.dtype), *(f"{size} {dim}" for dim, size in variable.sizes.items())])
            for key, variable in part.variables.items()
        }
        for part in (a, b)
    ]
    # An attribute of a variable that one of them does not have says nothing new.
    both = a.variables.keys() & b.variables.keys()
    attributes = [dict(_attributes(part, both)) for part in (a, b)]
    return Difference(name, tuple(filter(None, found)), _aspects(*shapes), _aspects(*attributes), notes=notes)


def _aspects(a: Mapping[str, Plain], b: Mapping[str, Plain]) -> tuple[Aspect, ...]:
    # By their texts: 1 is not 1.0 then, 0.0 not -0.0, and NaN is NaN.
    names = [name for name in sorted(a.keys() | b.keys()) if repr(a.get(name)) != repr(b.get(name))]
    return tuple(Aspect(name, a.get(name), b.get(name)) for name in names)


def _attributes(dataset: xr.Dataset, variables: Iterable[Hashable]) -> Iterator[tuple[str, Plain]]:
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
    shared = {name for name in a.variables if name in b.variables and a[name].dims == b[name].dims}
    left, right = (part.drop_vars(part.variables.keys() - shared) for part in (a, b))
    notes = []
    for dimension in [name for name in left.sizes if left.sizes[name] != right.sizes.get(name)]:
        if all(dimension in part.indexes and part.indexes[dimension].is_unique for part in (left, right)):
            left, right = xr.align(left, right, join="inner", exclude=set(left.sizes) - {dimension})
            notes.append(f"compared at the {left.sizes[dimension]} places along {dimension} that both have")
        else:
            left, right = (part.drop_dims([dimension]) for part in (left, right))
            notes.append(f"not compared along {dimension}: its sizes differ, and its places have no labels")
    return left, right, tuple(notes)


def values_difference(a: xr.DataArray, b: xr.DataArray, where: Callable[[Index], str]) -> Values | None:
    """Return how two variables of numbers, of one name and shape, differ; None if they do not.

    where: says in words where an index is. NaN equals NaN; 0.0 and -0.0 differ, by 0 ulp.
    """
    x, y = a.values, b.values
    differ, has_floats = np.asarray(x != y), "f" in x.dtype.kind + y.dtype.kind
    if has_floats:
        differ = (differ | (np.signbit(x) != np.signbit(y))) & ~(np.isnan(x) & np.isnan(y))
    if not differ.any():
        return None
    count, amounts = int(differ.sum()), dict[str, Any]()
    titles: dict[Index, str] = {tuple(np.argwhere(differ)[0].tolist()): "first "}
    measured = differ & np.isfinite(x) & np.isfinite(y)
    if "flag_meanings" in a.attrs:
        found = Counter(zip(_words(a, x[differ]), _words(b, y[differ]), strict=True))
        amounts["changes"] = tuple(f"{number} from {one} to {other}" for (one, other), number in found.most_common())
    elif measured.any():
        wider = np.result_type(x.dtype, y.dtype) if has_floats else np.dtype(np.float64)
        left, right = x[measured].astype(wider), y[measured].astype(wider)
        with np.errstate(over="ignore"):  # two large numbers of opposite sign may be further apart than a double says
            apart = np.abs(left - right)
        amounts["absolute"] = float(apart.max())
        if has_floats:
            scale = np.maximum(np.abs(left), np.abs(right))
            share = np.minimum(apart / np.where(scale > 0, scale, 1), 2.0)
            amounts |= {"ulp": int(ulps(left, right).max()), "relative": float(share.max())}
        largest = tuple(np.argwhere(measured)[int(apart.argmax())].tolist())
        titles[largest] = "first and largest " if largest in titles else "largest "
    places = tuple(
        Place(f"{title if count > 1 else ''}at {where(index)}", *_words(a, x[index]), *_words(b, y[index]))
        for index, title in titles.items()
    )
    unmeasured = 0 if "changes" in amounts else count - int(measured.sum())
    return Values(str(a.name), str(a.attrs.get("units", "1")), differ.size, count, places, unmeasured, **amounts)


def ulps(a: npt.NDArray[np.floating[Any]], b: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.uint64]:
    """Return how many steps of `numpy.nextafter` lead from `a` to `b`, elementwise, in their shape.

    A unit in the last place (ulp) is such a step, here as everywhere in `stiffdice diff`: from 1.0 up it is 2⁻⁵², down
    2⁻⁵³, and from zero 5e-324. Steps are counted through zero and the subnormal numbers; -0.0 is where 0.0 is. From
    the largest double to infinity is one.

    a, b: of one type (float16, float32 or float64, in this machine's byte order) and shape, without NaN. Floating-point
    numbers of one sign are in the order of their bits read as whole numbers (IEEE 754), which makes them countable.
    """
    bits = [values.view(f"i{values.itemsize}") for values in (a, b)]
    # The place of each number in the row of all of its type, both zeros at 0.
    x, y = (np.where(part < 0, np.iinfo(part.dtype).min - part, part).astype(np.int64) for part in bits)
    # Modulo 2⁶⁴ the difference is right even where it is beyond int64.
    return np.where(y > x, y - x, x - y).view(np.uint64)


def _words(variable: xr.DataArray, values: npt.ArrayLike) -> list[str]:
    """Return values exactly: those of an enum by their meanings, numbers by their shortest digits."""
    numbers = np.ravel(values).tolist()
    return list(map(meanings_of(variable).__getitem__ if "flag_meanings" in variable.attrs else repr, numbers))


def _located(dataset: xr.Dataset, dimensions: Sequence[Hashable], index: Index) -> str:
    """Return where an index is by what the file says of it: `time = 1.25 s, axis z`, `contact gated, member = 3`."""
    told = []
    for dimension, k in zip(dimensions, index, strict=True):
        along = {name: labels for name, labels in dataset.coords.items() if labels.dims == (dimension,)}
        if dimension in dataset.variables:
            shown = [dataset[dimension]]
        else:
            shown = [along[name] for name in CELL if name in along] or list(along.values())
        told += [_label(labels, k) for labels in shown] or [f"{dimension} {k}"]
    return ", ".join(told)


def _label(labels: xr.DataArray, k: int) -> str:
    (word,) = _words(labels, labels.values[k])
    if "flag_meanings" in labels.attrs:
        return f"{labels.name} {word}"
    units = str(labels.attrs.get("units", "1"))
    number = f"{labels.values[k]:.10g}" if labels.dtype.kind == "f" else word
    return f"{labels.name} = {number}" + ("" if units == "1" else f" {units}")
