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
    """One value that differs: where it is (`first at time = 2 s`), in words and as an index; both values, exactly."""

    where: str
    index: Index
    a: str
    b: str


@dataclass(frozen=True)
class Values:
    """How the values of one variable differ.

    count: how many of `of`. places: the first, and the one of the largest difference. unmeasured: those of which one is
    NaN or infinite. Of the others the largest difference in ulp [1], relative [1] to the larger of the two magnitudes,
    and absolute [units]; of whole numbers the last alone, of enums and text none. changes: of an enum, how many changed
    from which word to which.
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
    """Return how two variables of one name and shape differ; None if they do not.

    where: says in words where an index is. NaN equals NaN; 0.0 and -0.0 differ, by 0 ulp.
    """
    x, y = a.values, b.values
    kinds = {x.dtype.kind, y.dtype.kind}
    is_number = kinds <= set("fiub") and "flag_meanings" not in a.attrs
    differ = np.asarray(x != y)
    if is_number and "f" in kinds:
        differ = (differ | (np.signbit(x) != np.signbit(y))) & ~(np.isnan(x) & np.isnan(y))
    if not differ.any():
        return None
    count, first = int(differ.sum()), _first(differ)
    measured = differ & np.isfinite(x) & np.isfinite(y) if is_number else np.zeros_like(differ)
    largest, amounts = _largest(x, y, measured) if measured.any() else (first, {})
    titles = {first: "first "}
    if amounts:
        titles[largest] = "first and largest " if largest == first else "largest "
    if count == 1:
        titles[first] = ""
    return Values(
        str(a.name),
        str(a.attrs.get("units", "1")),
        differ.size,
        count,
        tuple(
            Place(f"{title}at {where(index)}", index, text(a, x[index]), text(b, y[index]))
            for index, title in titles.items()
        ),
        unmeasured=count - int(measured.sum()) if is_number else 0,
        changes=_changes(a, b, differ),
        **amounts,
    )


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

    a, b: of one type (float16, float32 or float64) and shape, without NaN. Floating-point numbers of one sign are in
    the order of their bits read as whole numbers (IEEE 754), which is what makes them countable.
    """
    places_a, places_b = _places(a), _places(b)
    # Modulo 2⁶⁴ the difference is right even where it is beyond int64.
    up, down = places_b.view(np.uint64) - places_a.view(np.uint64), places_a.view(np.uint64) - places_b.view(np.uint64)
    return np.where(places_b > places_a, up, down)


def _places(values: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.int64]:
    """Return the place of each number in the row of all of its type, both zeros at 0."""
    native = np.ascontiguousarray(values, values.dtype.newbyteorder("=")).reshape(np.shape(values))
    whole = np.dtype(f"i{native.dtype.itemsize}")
    bits = native.view(whole)
    lowest = np.iinfo(whole).min
    return np.where(bits < 0, lowest - bits, bits).astype(np.int64)


def _changes(a: xr.DataArray, b: xr.DataArray, differ: npt.NDArray[np.bool_]) -> tuple[str, ...]:
    """Return how many values of an enum changed from which word to which, the most first."""
    if "flag_meanings" not in a.attrs:
        return ()
    found = Counter(zip(a.values[differ].tolist(), b.values[differ].tolist(), strict=True))
    return tuple(
        f"{number} from {text(a, np.int8(one))} to {text(b, np.int8(other))}"
        for (one, other), number in found.most_common()
    )


def text(variable: xr.DataArray, value: Any) -> str:
    """Return a value exactly: an enum by its meaning, a number by its shortest digits."""
    if "flag_meanings" in variable.attrs and isinstance(value, np.integer):
        meanings = meanings_of(variable)
        return meanings[int(value)] if 0 <= int(value) < len(meanings) else str(value)
    return repr(value.item()) if isinstance(value, np.generic) else repr(value)


def located(dataset: xr.Dataset, dimensions: Sequence[str], index: Index) -> str:
    """Return where an index is by what the file says of it, such as `time = 1.25 s, axis z`."""
    return ", ".join(_at(dataset, dimension, k) for dimension, k in zip(dimensions, index, strict=True))


def _at(dataset: xr.Dataset, dimension: str, k: int) -> str:
    """Return one place along a dimension: `axis z`, `member 3`, `time = 1.25 s`, `gated, stiffness = 10 kg s-2`."""
    if dimension in dataset.variables:
        labels = dataset[dimension]
        if "flag_meanings" in labels.attrs or (labels.dtype.kind in "iu" and labels.attrs.get("units") == "1"):
            return f"{dimension} {text(labels, labels.values[k])}"
        return _label(labels, k)
    if dimension == "cell" and all(name in dataset.variables for name in CELL):
        return ", ".join(_label(dataset[name], k) for name in CELL)
    told = ", ".join(_label(labels, k) for labels in dataset.coords.values() if labels.dims == (dimension,))
    return f"{dimension} {k}" + (f" ({told})" if told else "")


def _label(labels: xr.DataArray, k: int) -> str:
    """Return one value of a coordinate: `gated`, `steps = 812`, `stiffness = 1000 kg s-2`."""
    value = labels.values[k]
    if "flag_meanings" in labels.attrs:
        return text(labels, value)
    number = f"{value:.10g}" if labels.dtype.kind == "f" else str(value)
    units = str(labels.attrs.get("units", "1"))
    return f"{labels.name} = {number}" + ("" if units == "1" else f" {units}")
