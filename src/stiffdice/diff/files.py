"""Two files: HDF5 by what they say, others byte by byte."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
import xarray as xr

from stiffdice.diff.description import ATTRIBUTE, Aspect, aspects, describe
from stiffdice.diff.values import Cell, Locate, Values, differences, located
from stiffdice.errors import InputError
from stiffdice.io.read import open_file

_AT_ONCE = 1 << 20  # bytes read at a time
_LINE = 160  # bytes of a line that are kept


@dataclass(frozen=True)
class Cells:
    """Which cells two sets of runs have: in both and equal or not, or in one of them."""

    same: int
    differing: int
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]


@dataclass(frozen=True)
class Difference:
    """How two files (or all shards of a sweep) of one name differ.

    aspects: in what they say besides values. values: in which variables. cells: of runs, which they are of. since: from
    when on values differ, in words, if that is not the start. line: of text that differs, its number and both texts.
    offset: of other bytes, the first. unreadable: why files cannot be read. dealt: whether the cells of runs are dealt
    to shards otherwise, which is no difference. notes: what else is to say.
    """

    name: str
    aspects: tuple[Aspect, ...] = ()
    values: tuple[Values, ...] = ()
    cells: Cells | None = None
    since: str = ""
    line: tuple[int, str, str] | None = None
    offset: int | None = None
    unreadable: tuple[str, ...] = ()
    dealt: bool = False
    notes: tuple[str, ...] = ()

    @property
    def numbers(self) -> bool:
        """Whether values, or what is there of them, differ; not only attributes or other files' bytes."""
        cells = self.cells is not None and bool(self.cells.only_a or self.cells.only_b)
        return bool(self.values or self.unreadable) or cells or any(part.what != ATTRIBUTE for part in self.aspects)

    @property
    def same(self) -> bool:
        """Whether both say the same."""
        return not (self.numbers or self.aspects) and self.offset is None


def first_difference(a: Path, b: Path) -> int | None:
    """Return the offset of the first byte in which two files differ, None if they do not; raises InputError."""
    offset = 0
    with _opened(a) as left, _opened(b) as right:
        while True:
            part, other = left.read(_AT_ONCE), right.read(_AT_ONCE)
            if part != other:
                common = min(len(part), len(other))
                apart = np.frombuffer(part, np.uint8, common) != np.frombuffer(other, np.uint8, common)
                return offset + (int(np.argmax(apart)) if apart.any() else common)
            if not part:
                return None
            offset += len(part)


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None


def bytes_difference(name: str, a: Path, b: Path, offset: int) -> Difference:
    """Return how two files that first differ at an offset do: of text the first line that is another."""
    line = None
    if _is_text(a) and _is_text(b):
        number, start = _line_at(a, offset)
        line = number, _text_at(a, start), _text_at(b, start)
    return Difference(name, offset=offset, line=line)


def _is_text(path: Path) -> bool:
    with path.open("rb") as file:
        return b"\0" not in file.read(4096)


def _line_at(path: Path, offset: int) -> tuple[int, int]:
    """Return the number of the line that an offset is in, and where it starts."""
    number, start, place = 1, 0, 0
    with path.open("rb") as file:
        while place < offset:
            part = file.read(min(_AT_ONCE, offset - place))
            number += part.count(b"\n")
            last = part.rfind(b"\n")
            start = place + last + 1 if last >= 0 else start
            place += len(part)
    return number, start


def _text_at(path: Path, start: int) -> str:
    with path.open("rb") as file:
        file.seek(start)
        return file.readline(_LINE).decode("utf-8", "replace").rstrip("\r\n")


def data_difference(name: str, a: Path, b: Path) -> Difference:
    """Return how two HDF5 files of ours differ, at once in memory; raises InputError if one cannot be trusted."""
    return dataset_difference(name, open_file(a), open_file(b))


def dataset_difference(name: str, a: xr.Dataset, b: xr.Dataset) -> Difference:
    """Return how two datasets differ."""
    told = aspects(describe(a), describe(b))
    left, right, notes = overlap(a, b)
    values = compared(left, right)
    return Difference(name, tuple(told), values, since=_since(left, values), notes=notes)


def compared(a: xr.Dataset, b: xr.Dataset, cells: Sequence[Cell] = ()) -> tuple[Values, ...]:
    """Return the variables of both, of equal shapes, whose values differ.

    cells: what each cell is called, if not by its number.
    """
    found = (differences(name, a[name], b[name], _locate(a, name, cells)) for name in map(str, a.variables))
    return tuple(values for values in found if values.count)


def _locate(dataset: xr.Dataset, name: str, cells: Sequence[Cell]) -> Locate:
    dimensions = tuple(map(str, dataset[name].dims))
    return lambda index: located(dataset, dimensions, index, cells)


def overlap(a: xr.Dataset, b: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset, tuple[str, ...]]:
    """Return of two datasets what can be compared value by value, and what is to say about the rest.

    These are the variables that both have along the same dimensions. Where one goes on longer, its beginning is taken,
    if the labels there are the same; what lies along other dimensions of two sizes is left out.
    """
    shared = [name for name in a.variables if name in b.variables and a[name].dims == b[name].dims]
    left, right = (part.drop_vars([name for name in part.variables if name not in shared]) for part in (a, b))
    notes = []
    for dimension in [name for name in left.sizes if left.sizes[name] != right.sizes[name]]:
        size = min(left.sizes[dimension], right.sizes[dimension])
        short = [part.isel({dimension: slice(size)}) for part in (left, right)]
        labels = [name for name in left.coords if left[name].dims == (dimension,)]
        if size and all(_equal(*(part[name] for part in short)) for name in labels):
            left, right = short
            notes.append(f"compared up to {dimension} {size}, where the shorter ends")
        else:
            along = [name for name in left.variables if dimension in left[name].dims]
            left, right = left.drop_vars(along), right.drop_vars(along)
            notes.append(f"not compared along {dimension}: its places are others")
    return left, right, tuple(notes)


def _equal(a: xr.DataArray, b: xr.DataArray) -> bool:
    return a.dtype == b.dtype and a.values.tobytes() == b.values.tobytes()


def _since(dataset: xr.Dataset, values: tuple[Values, ...]) -> str:
    """Return from when on the values of a trajectory differ, if not from its start."""
    firsts = [
        part.first.index[0]
        for part in values
        if part.first is not None and part.variable != "time" and dataset[part.variable].dims[:1] == ("time",)
    ]
    if min(firsts, default=0) == 0 or "time" not in dataset.variables:
        return ""
    return located(dataset, ("time",), (min(firsts),))[1]
