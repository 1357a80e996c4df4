"""Where the values of a variable differ, and by how much."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.archive.compare.ulps import ulps
from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.content_digest import CELL

# So many places that differ are all told; of more, the first and the one of the largest difference.
LISTED = 5

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

    count: how many of `of`. unmeasured: those of which one is NaN or infinite. Of the others the largest difference in
    ulp [1], relative [1] to the larger of the two magnitudes, and absolute [units]; of whole numbers the last alone, of
    enums and text none. changes: of an enum, how many changed from which word to which.
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
    count, units = int(differ.sum()), str(a.attrs.get("units", "1"))
    indices = [tuple(index) for index in np.argwhere(differ)[: LISTED + 1].tolist()]
    titles = dict.fromkeys(indices, "") if count <= LISTED else {indices[0]: "first "}
    found = Values(str(a.name), units, differ.size, count, (), changes=_changes(a, b, differ))
    measured = differ & np.isfinite(x) & np.isfinite(y) if is_number else np.zeros_like(differ)
    if measured.any():
        found, place = _measured(found, x, y, measured)
        if count > LISTED:
            titles[place] = f"{titles.get(place, '')}{'and ' if place in titles else ''}largest "
    places = (
        Place(f"{title}at {where(index)}", index, text(a, a.values[index]), text(b, b.values[index]))
        for index, title in titles.items()
    )
    return replace(found, places=tuple(places), unmeasured=count - int(measured.sum()) if is_number else 0)


def _measured(
    found: Values, x: npt.NDArray[Any], y: npt.NDArray[Any], measured: npt.NDArray[np.bool_]
) -> tuple[Values, Index]:
    """Return the same with the largest of the flagged differences, and where that is."""
    has_floats = "f" in x.dtype.kind + y.dtype.kind
    wider = np.result_type(x.dtype, y.dtype) if has_floats else np.dtype(np.float64)
    left, right = x[measured].astype(wider), y[measured].astype(wider)
    with np.errstate(over="ignore"):  # two large numbers of opposite sign may be further apart than a double can say
        apart = np.abs(left - right)
    place = tuple(np.argwhere(measured)[int(apart.argmax())].tolist())
    found = replace(found, absolute=float(apart.max()))
    if has_floats:
        scale = np.maximum(np.abs(left), np.abs(right))
        share = np.minimum(apart / np.where(scale > 0, scale, 1), 2.0)
        found = replace(found, ulp=int(ulps(left, right).max()), relative=float(share.max()))
    return found, place


def _changes(a: xr.DataArray, b: xr.DataArray, differ: npt.NDArray[np.bool_]) -> tuple[str, ...]:
    """Return how many values of an enum changed from which word to which, the most first."""
    if "flag_meanings" not in a.attrs:
        return ()
    found = Counter(zip(a.values[differ].tolist(), b.values[differ].tolist(), strict=True))
    pairs = found.most_common()
    return tuple(
        f"{number} from {text(a, np.int8(one))} to {text(b, np.int8(other))}" for (one, other), number in pairs
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
    labels_of = [variable for variable in dataset.coords.values() if variable.dims == (dimension,)]
    told = ", ".join(_label(labels, k) for labels in labels_of)
    return f"{dimension} {k}" + (f" ({told})" if told else "")


def _label(labels: xr.DataArray, k: int) -> str:
    """Return one value of a coordinate: `gated`, `steps = 812`, `stiffness = 1000 kg s-2`."""
    value = labels.values[k]
    if "flag_meanings" in labels.attrs:
        return text(labels, value)
    number = f"{value:.10g}" if labels.dtype.kind == "f" else str(value)
    units = str(labels.attrs.get("units", "1"))
    return f"{labels.name} = {number}" + ("" if units == "1" else f" {units}")
