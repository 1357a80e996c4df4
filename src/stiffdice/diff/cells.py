"""The runs of two sweeps, cell by cell, however the cells are dealt to files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.diff.description import DIMENSIONS, TYPE, Description, Key, aspects, describe
from stiffdice.diff.files import Cells, Difference, compared, overlap
from stiffdice.diff.values import Cell, Values, label
from stiffdice.errors import InputError, RefusedError
from stiffdice.io import seal
from stiffdice.io.digest import CELL, Plain, cell_digests
from stiffdice.io.read import parts

# Cells of a file to read at a time; none: as many as are well read together.
AT_ONCE: int | None = None

# Runs that differ are read again, of each side about so many at a time: a run takes some 100 bytes.
RUNS_AT_ONCE = 200_000

Table = npt.NDArray[np.void]

# A cell: what it is known by (bits, so that NaN is itself), the SHA-256 of its runs, and where it is.
_ROW = np.dtype([(CELL[0], "i8"), (CELL[1], "i8"), (CELL[2], "i8"), ("digest", "V32"), ("file", "i4"), ("row", "i8")])


def holds_runs(path: Path) -> bool:
    """Return whether a file is a shard; False, too, if it cannot be read, which its reader tells better."""
    try:
        if seal.is_sealed(path):
            seal.check(path)
        with h5py.File(path, "r") as file:
            return {"cell", "member", *CELL} <= set(file)
    except (OSError, RuntimeError, ValueError, InputError):
        return False


@dataclass(frozen=True)
class _Side:
    """All shards of one sweep: a row for each cell, sorted by its key, and what the files say besides values."""

    files: Sequence[Path]
    names: Sequence[str]
    cells: Table
    said: dict[Key, dict[str, Plain]]  # what the files say, by its text: one thing, if they agree
    members: int
    unreadable: tuple[str, ...]
    twice: int

    @property
    def description(self) -> Description:
        """What the files say, joined where they do not agree among themselves."""
        return {
            key: next(iter(said.values())) if len(said) == 1 else " or ".join(sorted(said))
            for key, said in self.said.items()
        }

    @property
    def uniform(self) -> bool:
        """Whether all files have the same variables, types and dimensions."""
        return all(len(said) == 1 for key, said in self.said.items() if key[1] in (TYPE, DIMENSIONS))


def runs_difference(name: str, a: Mapping[str, Path], b: Mapping[str, Path]) -> Difference:
    """Return how the runs in two sets of shards differ, matched by their cells.

    a, b: files by what they are called, which is nothing if there is one only. A file that cannot be trusted is told.
    In memory are some 80 bytes for each cell, whatever its runs, and RUNS_AT_ONCE of those that differ.
    """
    left, right = _side(a), _side(b)
    _, at_left, at_right = np.intersect1d(
        _keys(left.cells), _keys(right.cells), assume_unique=True, return_indices=True
    )
    differ = left.cells["digest"][at_left] != right.cells["digest"][at_right]
    values: tuple[Values, ...] = ()
    notes = [f"{side} has {part.twice} cells twice" for side, part in (("A", left), ("B", right)) if part.twice]
    if left.uniform and right.uniform:
        values, more = _values(left, right, left.cells[at_left], right.cells[at_right], differ)
        notes += more
    else:
        notes.append("values are not compared: not all shards of one side have the same variables")
    dealt = _dealt(left, at_left) != _dealt(right, at_right)
    if dealt:
        notes.append(f"the cells are dealt otherwise: to {len(a)} shards and to {len(b)}, or in another order")
    return Difference(
        name,
        tuple(aspects(left.description, right.description)),
        values,
        cells=Cells(
            int((~differ).sum()),
            int(differ.sum()),
            _only(left, at_left),
            _only(right, at_right),
        ),
        unreadable=(*left.unreadable, *right.unreadable),
        dealt=dealt,
        notes=tuple(notes),
    )


def _keys(cells: Table) -> npt.NDArray[Any]:
    """Return the keys of cells as something that sorts."""
    keys = np.empty(len(cells), [(name, "i8") for name in CELL])
    for name in CELL:
        keys[name] = cells[name]
    return keys


def _side(shards: Mapping[str, Path]) -> _Side:
    tables, unreadable = [np.empty(0, _ROW)], []
    said: dict[Key, dict[str, Plain]] = {}
    members = 0
    for number, path in enumerate(shards.values()):
        first = 0
        try:
            for part in parts(path, AT_ONCE):
                if any(part[name].dims != ("cell",) for name in CELL):
                    raise RefusedError(f"{path}: {', '.join(CELL)} are not one number for each cell")
                tables.append(_table(part, number, first))
                first += part.sizes["cell"]
                members = max(members, part.sizes.get("member", 1))
                for key, value in describe(part, free="cell").items():
                    said.setdefault(key, {})[repr(value)] = value
        except InputError as error:
            unreadable.append(str(error))
    cells = np.concatenate(tables)
    _, once = np.unique(_keys(cells), return_index=True)
    files, names = list(shards.values()), list(shards)
    return _Side(files, names, cells[once], said, members, tuple(unreadable), len(cells) - len(once))


def _table(part: xr.Dataset, file: int, first: int) -> Table:
    table = np.empty(part.sizes["cell"], _ROW)
    for name in CELL:
        values = part[name].values
        table[name] = values.astype(np.float64).view(np.int64) if values.dtype.kind == "f" else values
    table["digest"] = cell_digests(part)
    table["file"] = file
    table["row"] = first + np.arange(len(table))
    return table


def _dealt(side: _Side, at: npt.NDArray[np.intp]) -> list[tuple[str, int]]:
    """Return in which file, and where in it, each cell is."""
    return [(side.names[cell["file"]], int(cell["row"])) for cell in side.cells[at]]


def _only(side: _Side, both: npt.NDArray[np.intp]) -> tuple[str, ...]:
    """Return in words the cells of one side that the other does not have."""
    alone = np.ones(len(side.cells), bool)
    alone[both] = False
    cells = side.cells[alone]
    labels = [_labels(side, cells, name) for name in CELL]
    return tuple(
        f"{cell.name} ({', '.join(parts)})" for cell, *parts in zip(_named(side.names, cells), *labels, strict=True)
    )


def _labels(side: _Side, cells: Table, name: str) -> list[str]:
    """Return what cells are told by, each in words."""
    bits = cells[name]
    kinds, places = np.unique(bits, return_inverse=True)
    values = kinds.view(np.float64) if name == "stiffness" else kinds
    attributes = {
        attribute: next(iter(said.values()))
        for (variable, _, attribute), said in side.said.items()
        if variable == name and attribute
    }
    labels = xr.DataArray(values, dims="cell", name=name, attrs=attributes)
    texts = [label(labels, k) for k in range(len(values))]
    return [texts[place] for place in places]


def _values(
    left: _Side, right: _Side, cells: Table, others: Table, differ: npt.NDArray[np.bool_]
) -> tuple[tuple[Values, ...], tuple[str, ...]]:
    """Return the variables whose values differ, of all cells of both, and what is to say about the rest.

    cells, others: those of both sides, matched.
    """
    pairs = np.flatnonzero(differ)
    pairs = pairs[np.lexsort([cells["row"][pairs], cells["file"][pairs]])]
    step = max(1, RUNS_AT_ONCE // max(left.members, right.members, 1))
    found: dict[str, Values] = {}
    notes: tuple[str, ...] = ()
    for start in range(0, len(pairs), step):
        some = pairs[start : start + step]
        a, b, notes = overlap(_fetch(left.files, cells[some]), _fetch(right.files, others[some]))
        for values in compared(a, b, _named(left.names, cells[some])):
            found[values.variable] = found[values.variable].and_then(values) if values.variable in found else values
    # The cells that are equal have values, too; and a variable may differ in some of these parts only.
    sizes = {name: a[name].size // a.sizes["cell"] * len(cells) for name in found} if found else {}
    return tuple(replace(values, of=sizes[name]) for name, values in found.items()), notes


def _named(shards: Sequence[str], cells: Table) -> list[Cell]:
    """Return what cells are called: by their number in their shard, and the shard, if that is called anything."""
    return [
        Cell(row, f"cell {row} of {shards[file]}".removesuffix(" of "))
        for row, file in zip(cells["row"].tolist(), cells["file"].tolist(), strict=True)
    ]


def _fetch(files: Sequence[Path], cells: Table) -> xr.Dataset:
    """Return so many cells, in the order asked."""
    pieces, places = [], []
    for file in np.unique(cells["file"]):
        asked = np.flatnonzero(cells["file"] == file)
        asked = asked[np.argsort(cells["row"][asked])]
        pieces += list(_picked(files[file], cells["row"][asked]))
        places.append(asked)
    whole = pieces[0]
    if len(pieces) > 1:
        whole = xr.concat(
            pieces, "cell", data_vars="minimal", coords="minimal", compat="override", combine_attrs="override"
        )
    return whole.isel(cell=np.argsort(np.concatenate(places)))


def _picked(path: Path, rows: npt.NDArray[np.int64]) -> Iterator[xr.Dataset]:
    """Yield the cells of a file at ascending rows, part by part."""
    first = 0
    for part in parts(path, AT_ONCE):
        inside = rows[(rows >= first) & (rows < first + part.sizes["cell"])] - first
        if len(inside):
            yield part.isel(cell=inside)
        first += part.sizes["cell"]
        if first > rows[-1]:
            return
