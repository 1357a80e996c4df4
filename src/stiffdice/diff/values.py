"""Where the values of a variable differ, and by how much."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.diff.ulps import ulps
from stiffdice.io.digest import CELL
from stiffdice.io.enums import meanings_of

Index = tuple[int, ...]

# Where an index is: as an index in the file, and in words.
Locate = Callable[[Index], tuple[Index, str]]
Flags = npt.NDArray[np.bool_]


class Cell(NamedTuple):
    """A cell's number in its shard, and what it is called."""

    row: int
    name: str


@dataclass(frozen=True)
class Place:
    """One value that differs: its index in A, where that is in words, and both values, exactly."""

    index: Index
    where: str
    a: str
    b: str


@dataclass(frozen=True)
class Extreme:
    """The largest of some differences, and where it is."""

    size: float
    place: Place


@dataclass(frozen=True)
class Values:
    """How the values of one variable differ.

    count: how many of `of`; among them one_nan where only one is NaN, one_infinite where one is infinite and the other
    another number, signs where both are zero. The largest differences are of the others: ulp [1], relative [1] (to
    the larger of the two magnitudes), absolute [units]; of whole numbers absolute only, of enums and text none.
    """

    variable: str
    units: str
    of: int
    count: int = 0
    one_nan: int = 0
    one_infinite: int = 0
    signs: int = 0
    first: Place | None = None
    ulp: Extreme | None = None
    relative: Extreme | None = None
    absolute: Extreme | None = None

    def and_then(self, more: Values) -> Values:
        """Return the same of these values and of those that come after them."""
        return replace(
            self,
            of=self.of + more.of,
            count=self.count + more.count,
            one_nan=self.one_nan + more.one_nan,
            one_infinite=self.one_infinite + more.one_infinite,
            signs=self.signs + more.signs,
            first=self.first or more.first,
            ulp=_larger(self.ulp, more.ulp),
            relative=_larger(self.relative, more.relative),
            absolute=_larger(self.absolute, more.absolute),
        )


def _larger(one: Extreme | None, other: Extreme | None) -> Extreme | None:
    if one is None or other is None:
        return one or other
    return other if other.size > one.size else one


def differences(name: str, a: xr.DataArray, b: xr.DataArray, locate: Locate) -> Values:
    """Return how two variables of one shape differ.

    locate: says where an index is. Floats of two widths are compared as the wider, floats and whole numbers as
    float64.
    """
    left, right = a.values, b.values
    told = Values(name, str(a.attrs.get("units", "")), left.size)
    kinds = left.dtype.kind + right.dtype.kind
    if "f" in kinds and set(kinds) <= set("fiub"):
        with np.errstate(all="ignore"):  # of numbers at the ends of the range, and of signalling NaN
            return _floats(told, a, b, locate)
    differ = np.asarray(left != right)
    if not differ.any():
        return told
    told = replace(told, count=int(differ.sum()), first=_place(a, b, _first(differ), locate))
    if "flag_meanings" in a.attrs or not set(kinds) <= set("iu"):
        return told
    return replace(told, absolute=_largest(_apart(left, right), differ, a, b, locate))


def _floats(told: Values, a: xr.DataArray, b: xr.DataArray, locate: Locate) -> Values:
    wider = np.result_type(a.dtype, b.dtype)
    left, right = a.values.astype(wider), b.values.astype(wider)
    holes_left, holes_right = np.isnan(left), np.isnan(right)
    differ = ((left != right) | (np.signbit(left) != np.signbit(right))) & ~(holes_left & holes_right)
    if not differ.any():
        return told
    one_nan = holes_left ^ holes_right
    one_infinite = differ & ~one_nan & (np.isinf(left) | np.isinf(right))
    signs = differ & (left == 0) & (right == 0)
    told = replace(
        told,
        count=int(differ.sum()),
        one_nan=int(one_nan.sum()),
        one_infinite=int(one_infinite.sum()),
        signs=int(signs.sum()),
        first=_place(a, b, _first(differ), locate),
    )
    measured = differ & ~one_nan & ~one_infinite & ~signs
    if not measured.any():
        return told
    apart = np.abs(left - right)
    scale = np.maximum(np.abs(left), np.abs(right))
    # Two large numbers of opposite sign may be further apart than a double can say.
    share = np.where(np.isinf(apart), np.abs(left / 2 - right / 2) / (scale / 2), apart / scale)
    return replace(
        told,
        ulp=_largest(ulps(left, right), measured, a, b, locate),
        relative=_largest(share, measured, a, b, locate),
        absolute=_largest(apart, measured, a, b, locate),
    )


def _apart(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> npt.NDArray[np.uint64]:
    """Return how far whole numbers are apart; modulo 2⁶⁴ the difference is right even where it is beyond int64."""
    wide_a, wide_b = a.astype(np.uint64), b.astype(np.uint64)
    return np.where(a > b, wide_a - wide_b, wide_b - wide_a)


def _first(flags: Flags) -> Index:
    return tuple(int(k) for k in np.unravel_index(int(np.argmax(flags)), flags.shape))


def _largest(sizes: npt.NDArray[Any], flags: Flags, a: xr.DataArray, b: xr.DataArray, locate: Locate) -> Extreme:
    """Return the largest of the flagged differences, the first of them if there are several."""
    kept = np.where(flags, sizes, sizes.dtype.type(0))
    index = tuple(int(k) for k in np.unravel_index(int(np.argmax(kept)), kept.shape))
    return Extreme(kept[index].item(), _place(a, b, index, locate))


def _place(a: xr.DataArray, b: xr.DataArray, index: Index, locate: Locate) -> Place:
    return Place(*locate(index), _text(a, a.values[index]), _text(b, b.values[index]))


def _text(variable: xr.DataArray, value: Any) -> str:
    """Return a value exactly: an enum by its meaning, a number by its shortest digits."""
    if "flag_meanings" in variable.attrs and isinstance(value, np.integer):
        meanings = meanings_of(variable)
        return meanings[int(value)] if 0 <= int(value) < len(meanings) else str(value)
    return repr(value.item()) if isinstance(value, np.generic) else repr(value)


def located(
    dataset: xr.Dataset, dimensions: Sequence[str], index: Index, cells: Sequence[Cell] = ()
) -> tuple[Index, str]:
    """Return where an index is, as an index and by what the file says of it, such as `time = 1.25 s, axis z`.

    cells: what each cell is called, and its number there, if not by its number here.
    """
    numbers = list(index)
    words = []
    for k, (dimension, number) in enumerate(zip(dimensions, index, strict=True)):
        if dimension in dataset.variables:
            words.append(_of_dimension(dataset[dimension], number))
        else:
            name = f"{dimension} {number}"
            if cells and dimension == "cell":
                numbers[k], name = cells[number]
            labels = [label(dataset[part], number) for part in _labels(dataset, dimension)]
            words.append(name + (f" ({', '.join(labels)})" if labels else ""))
    return tuple(numbers), ", ".join(words)


def _labels(dataset: xr.Dataset, dimension: str) -> Sequence[str]:
    """Return the variables that tell one place along a dimension from another."""
    if dimension == "cell" and all(name in dataset.variables for name in CELL):
        return CELL
    return [str(name) for name, variable in dataset.coords.items() if variable.dims == (dimension,)]


def _of_dimension(labels: xr.DataArray, k: int) -> str:
    """Return one place along a dimension by its own label: `axis z`, `member 3`, `time = 1.25 s`."""
    if "flag_meanings" in labels.attrs or (labels.dtype.kind in "iu" and labels.attrs.get("units") == "1"):
        return f"{labels.name} {_text(labels, labels.values[k])}"
    return label(labels, k)


def label(labels: xr.DataArray, k: int) -> str:
    """Return one value of a coordinate: `gated`, `steps = 812`, `stiffness = 1000 kg s-2`."""
    value = labels.values[k]
    if "flag_meanings" in labels.attrs:
        return _text(labels, value)
    number = f"{value:.10g}" if labels.dtype.kind == "f" else str(value)
    units = str(labels.attrs.get("units", "1"))
    return f"{labels.name} = {number}" + ("" if units == "1" else f" {units}")
