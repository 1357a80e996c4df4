"""Where the values of a variable differ, and by how much."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.content_digest import CELL

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


def difference(a: xr.DataArray, b: xr.DataArray, where: Callable[[Index], str]) -> Values | None:
    """Return how two variables of numbers, of one name and shape, differ; None if they do not.

    where: says in words where an index is. NaN equals NaN; 0.0 and -0.0 differ, by 0 ulp.
    """
    x, y = a.values, b.values
    differ = np.asarray(x != y)
    if "f" in x.dtype.kind + y.dtype.kind:
        differ = (differ | (np.signbit(x) != np.signbit(y))) & ~(np.isnan(x) & np.isnan(y))
    if not differ.any():
        return None
    count, titles, amounts = int(differ.sum()), {_first(differ): "first "}, dict[str, Any]()
    if "flag_meanings" in a.attrs:
        found = Counter(zip(_words(a, x[differ]), _words(b, y[differ]), strict=True))
        amounts["changes"] = tuple(f"{number} from {one} to {other}" for (one, other), number in found.most_common())
    else:
        measured = differ & np.isfinite(x) & np.isfinite(y)
        amounts["unmeasured"] = count - int(measured.sum())
        if measured.any():
            largest, sizes = _largest(x, y, measured)
            titles[largest] = f"{titles.get(largest, '')}{'and ' if largest in titles else ''}largest "
            amounts |= sizes
    places = tuple(
        Place(f"{title if count > 1 else ''}at {where(index)}", *_words(a, x[index]), *_words(b, y[index]))
        for index, title in titles.items()
    )
    return Values(str(a.name), str(a.attrs.get("units", "1")), differ.size, count, places, **amounts)


def _first(flags: npt.NDArray[np.bool_]) -> Index:
    return tuple(np.argwhere(flags)[0].tolist())


def _largest(x: npt.NDArray[Any], y: npt.NDArray[Any], measured: npt.NDArray[np.bool_]) -> tuple[Index, dict[str, Any]]:
    """Return where the largest of the flagged differences is (absolutely), and the largest of each measure."""
    has_floats = "f" in x.dtype.kind + y.dtype.kind
    wider = np.result_type(x.dtype, y.dtype) if has_floats else np.dtype(np.float64)
    left, right = x[measured].astype(wider), y[measured].astype(wider)
    with np.errstate(over="ignore"):  # two large numbers of opposite sign may be further apart than a double can say
        apart = np.abs(left - right)
    found: dict[str, Any] = {"absolute": float(apart.max())}
    if has_floats:
        scale = np.maximum(np.abs(left), np.abs(right))
        share = np.minimum(apart / np.where(scale > 0, scale, 1), 2.0)
        found |= {"ulp": int(ulps(left, right).max()), "relative": float(share.max())}
    return tuple(np.argwhere(measured)[int(apart.argmax())].tolist()), found


def ulps(a: npt.NDArray[np.floating[Any]], b: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.uint64]:
    """Return how many steps of `numpy.nextafter` lead from `a` to `b`, elementwise, in their shape.

    A unit in the last place (ulp) is such a step, here as everywhere in `stiffdice diff`: from 1.0 up it is 2⁻⁵², down
    2⁻⁵³, and from zero 5e-324. Steps are counted through zero and the subnormal numbers; -0.0 is where 0.0 is. From
    the largest double to infinity is one.

    a, b: of one type (float16, float32 or float64, in this machine's byte order) and shape, without NaN. Floating-point
    numbers of one sign are in the order of their bits read as whole numbers (IEEE 754), which makes them countable.
    """
    places_a, places_b = _places(a), _places(b)
    # Modulo 2⁶⁴ the difference is right even where it is beyond int64.
    up, down = places_b.view(np.uint64) - places_a.view(np.uint64), places_a.view(np.uint64) - places_b.view(np.uint64)
    return np.where(places_b > places_a, up, down)


def _places(values: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.int64]:
    """Return the place of each number in the row of all of its type, both zeros at 0."""
    bits = values.view(f"i{values.itemsize}")
    return np.where(bits < 0, np.iinfo(bits.dtype).min - bits, bits).astype(np.int64)


def _words(variable: xr.DataArray, values: npt.ArrayLike) -> list[str]:
    """Return values exactly: those of an enum by their meanings, numbers by their shortest digits."""
    numbers = np.ravel(values).tolist()
    return list(map(meanings_of(variable).__getitem__ if "flag_meanings" in variable.attrs else repr, numbers))


def located(dataset: xr.Dataset, dimensions: Sequence[str], index: Index) -> str:
    """Return where an index is by what the file says of it, such as `time = 1.25 s, axis z`."""
    return ", ".join(_at(dataset, dimension, k) for dimension, k in zip(dimensions, index, strict=True))


def _at(dataset: xr.Dataset, dimension: str, k: int) -> str:
    """Return one place along a dimension: `axis z`, `member = 3`, `contact gated, stiffness = 10 kg s-2`."""
    if dimension in dataset.variables:
        return _label(dataset[dimension], k)
    along = {str(name): labels for name, labels in dataset.coords.items() if labels.dims == (dimension,)}
    shown = [along[name] for name in CELL if name in along] or along.values()
    return ", ".join(_label(labels, k) for labels in shown) or f"{dimension} {k}"


def _label(labels: xr.DataArray, k: int) -> str:
    (word,) = _words(labels, labels.values[k])
    if "flag_meanings" in labels.attrs:
        return f"{labels.name} {word}"
    units = str(labels.attrs.get("units", "1"))
    number = f"{labels.values[k]:.10g}" if labels.dtype.kind == "f" else word
    return f"{labels.name} = {number}" + ("" if units == "1" else f" {units}")
