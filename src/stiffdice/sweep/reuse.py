"""Runs that are there already: those in shards that an earlier plan of the same sweep left beside the ones planned now.

A grid that is extended, made denser or dealt otherwise has other shards, but most of its cells it had before; a run
depends on its cell alone, not on where that lies in a grid. Only shards of the same scene, code, libraries, model,
scheme and members are used, and of these only what is whole.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy.typing as npt
import xarray as xr

from stiffdice.errors import InputError
from stiffdice.io import reader
from stiffdice.io.content_digest import CELL
from stiffdice.io.text_file import rows_of
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.sweep.grid import Column, Piece, Sweep
from stiffdice.sweep.shard import Known, differing, shard_pattern

Cell = tuple[int, float, int]  # number of the contact law, stiffness [kg/s²], steps


def _cell(column: Column, steps: int) -> Cell:
    return list(CONTACT_LAWS).index(column.contact), column.stiffness, steps


class Kept:
    """The cells of some pieces that shards in a folder hold, but for the shards planned now.

    What is in memory are their places, and the cells of one shard that were asked for together.
    """

    def __init__(
        self,
        plan: Sweep,
        pieces: Sequence[Piece],
        folder: Path,
        planned: Collection[str],
        say: Callable[[str], None] = lambda text: None,
    ) -> None:
        """planned: names of the shards that are not to be used; say: is told what cannot be used."""
        wanted = {_cell(column, n) for column, steps in pieces for n in steps}
        elsewhere = _elsewhere(folder.parent / "shards.csv", pieces)
        self._places: dict[Cell, tuple[Path, int]] = {}
        like = shard_pattern(plan)
        for path in sorted(folder.glob("*.h5")):
            if path.stem in planned or path.stem in elsewhere:
                continue
            try:
                for number, cell in enumerate(_cells_of(path, like)):
                    if cell in wanted:
                        self._places.setdefault(cell, (path, number))
            except InputError as error:
                say(f"not used: {error}")
        self._held: dict[int, dict[str, npt.NDArray[Any]]] = {}
        self._of: tuple[Path, slice] | None = None

    def __len__(self) -> int:
        return len(self._places)

    def __call__(self, column: Column, steps: int) -> Known | None:
        """Return what gives some members of a cell, None if the cell is not there."""
        place = self._places.get(_cell(column, steps))
        return None if place is None else partial(self._runs, *place)

    def _runs(self, path: Path, number: int, members: slice) -> dict[str, npt.NDArray[Any]]:
        if self._of != (path, members) or number not in self._held:
            # Those after it are asked for next.
            at_once = max(1, reader.RUNS_AT_ONCE // (members.stop - members.start))
            numbers = sorted(k for of, k in self._places.values() if of == path and 0 <= k - number < at_once)
            runs = reader.some(path, numbers, members)
            self._of = path, members
            self._held = {k: {name: values[row] for name, values in runs.items()} for row, k in enumerate(numbers)}
        return self._held[number]


def _elsewhere(table: Path, pieces: Sequence[Piece]) -> set[str]:
    """Return the shards that hold none of the cells, as the table of an earlier collection says, if it is there.

    It saves opening all shards in every job, and decides no more than that; stiffness has six digits in it.
    """
    grounds = [part.column.stiffness for part in pieces]
    steps = [float(count) for part in pieces for count in part.steps]
    spans = {"stiffness_{}_kg_s-2": grounds, "steps_{}": steps} if steps else {}
    wanted = {name: (min(places), max(places)) for name, places in spans.items()}
    try:
        return {
            row["shard"]
            for row in rows_of(table)
            for name, (low, high) in wanted.items()
            if float(row[name.format("from")] or "inf") > high * (1 + 1e-5)
            or float(row[name.format("to")] or "-inf") < low * (1 - 1e-5)
        }
    except (InputError, KeyError, ValueError):
        return set()


def _cells_of(path: Path, like: xr.Dataset) -> Iterator[Cell]:
    """Yield the cells of a shard if its runs are those of another; raises InputError if it cannot be trusted."""
    attributes, cells = reader.head(path, CELL)
    if not differing(attributes, like.attrs):
        yield from zip(*(cells[name].tolist() for name in CELL), strict=True)
