"""Who computes what: the cells of a sweep, dealt to jobs that take about equally long.

A sweep is computed in rounds. The first scans every column; each of `refine` further ones puts cells between neighbours
whose members do not agree, as a survey of all cells so far shows. A round's cells, in the order of contact law,
stiffness and steps, are cut into shards of equal predicted cost (`cost`); a column may be cut, too.

How many shards there are, and their names, follow from the study alone: nothing has to be computed to know them. A
first round is cut at whole multiples of a job's work, counted from the softest ground of each contact law: harder
grounds that are added later leave the shards before them as they are.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.state import Array
from stiffdice.io.cf_enums import meanings_of
from stiffdice.sweep import cost_model
from stiffdice.sweep.grid import Piece, Sweep

# Of predicted work: what a job gets [s], and what it gets of a sweep too small for so many jobs, but no less than that.
SECONDS, JOBS, FEWEST_SECONDS = 120.0, 16, 4.0

# Work of the second round over that of the first; each later one has twice as much as the one before it.
_FIRST_REFINEMENT = 0.5


class Shard(NamedTuple):
    """Cells that one job computes and one file holds: number `part` of the `parts` of a round, counted from 0.

    seconds: predicted work. pieces: its cells, known beforehand in the first round, number 0, only.
    """

    round: int
    part: int
    parts: int
    seconds: float
    pieces: tuple[Piece, ...] = ()


@lru_cache(maxsize=64)
def of(sweep: Sweep) -> Mapping[str, Shard]:
    """Return the shards of all rounds by their ids: digests of all that their numbers depend on but the code.

    Kept, as half a millisecond for each column is a minute for 10⁵.
    """
    first = scan(sweep)
    prices = [costs(sweep, piece) for piece in first]
    total = math.fsum(float(seconds.sum()) for seconds in prices)
    work = sweep.seconds_per_job or max(FEWEST_SECONDS, min(SECONDS, total / JOBS))
    cut = list(_cut_at_multiples(first, prices, work))
    shards = {}
    for part, (pieces, seconds) in enumerate(cut):
        shards[_digest(sweep, sweep.of_runs, pieces)] = Shard(0, part, len(cut), seconds, pieces)
    columns = [piece.column for piece in first]
    expected, most = _FIRST_REFINEMENT * total, sum(len(piece.steps) for piece in first)
    for number in range(1, sweep.refine + 1):
        parts = max(1, min(math.ceil(expected / work), most))  # a round has fewer cells than those before it
        for part in range(parts):
            plan = [columns, number, part, parts]
            shards[_digest(sweep, sweep.of_cells, plan)] = Shard(number, part, parts, expected / parts)
        expected, most = 2 * expected, 2 * most
    return MappingProxyType(shards)


def rounds(shards: Mapping[str, Shard], number: int) -> dict[str, Shard]:
    """Return the shards of one round."""
    return {name: shard for name, shard in shards.items() if shard.round == number}


def scan(sweep: Sweep) -> list[Piece]:
    """Return the cells of the first round: the scan of every column."""
    return [Piece(column, tuple(sweep.scan(column))) for column in sweep.columns()]


def refined(sweep: Sweep, survey: xr.Dataset, number: int) -> list[Piece]:
    """Return the cells of a later round, by column; survey: all cells of the rounds before it, judged and sorted."""
    pieces = []
    criteria = [meanings_of(survey.criterion).index(name) for name in sweep.criteria]
    passing = 1 - survey.failing.values[criteria] / sweep.members
    contact, stiffness, steps = (survey[name].values for name in ("contact", "stiffness", "steps"))
    for column in sweep.columns():
        law = list(LAWS).index(column.contact)
        here = slice(*np.searchsorted(contact, [law, law + 1]))
        low, high = (
            here.start + np.searchsorted(stiffness[here], column.stiffness, side) for side in ("left", "right")
        )
        due = sweep.finer(column, steps[low:high].tolist(), passing[:, low:high], number)
        if due:
            pieces.append(Piece(column, tuple(due)))
    return pieces


def later(sweep: Sweep, survey: xr.Dataset, number: int, parts: int) -> list[tuple[Piece, ...]]:
    """Return the cells of each shard of a later round; survey: of all rounds before it."""
    return share(sweep, refined(sweep, survey, number), parts)


def share(sweep: Sweep, pieces: Sequence[Piece], parts: int) -> list[tuple[Piece, ...]]:
    """Return the pieces cut into so many parts of equal predicted cost; some may be empty."""
    prices = [costs(sweep, piece) for piece in pieces]
    total = math.fsum(float(seconds.sum()) for seconds in prices)
    found: list[tuple[Piece, ...]] = [()] * parts
    before = 0.0
    for piece, seconds in zip(pieces, prices, strict=True):
        reached = before + np.cumsum(seconds)
        middles = reached - seconds / 2
        numbers = np.minimum((middles / total * parts).astype(np.int64), parts - 1)
        for number, part in _runs_of(piece, numbers):
            found[number] = (*found[number], part)
        before = float(reached[-1])
    return found


def costs(sweep: Sweep, piece: Piece) -> Array:
    """Return the predicted work of each cell of a piece [s]."""
    return cost_model.of_scan(
        sweep.scene_of(piece.column),
        model=sweep.model,
        scheme=sweep.scheme,
        simulator=sweep.simulator,
        steps=piece.steps,
        members=sweep.members,
        criteria=sweep.criteria,
        early_stop=sweep.early_stop,
        horizon=sweep.horizon,
    )


def _cut_at_multiples(
    pieces: Sequence[Piece], prices: Sequence[Array], work: float
) -> Iterator[tuple[tuple[Piece, ...], float]]:
    """Yield pieces in parts, each with its cost: a new one with every contact law, and whenever `work` more is done.

    What is left at the end of a law, if it is less than half of that, is done with the part before.
    """
    totals: dict[str, float] = {}
    for piece, each in zip(pieces, prices, strict=True):
        totals[piece.column.contact] = totals.get(piece.column.contact, 0.0) + float(each.sum())
    parts: dict[tuple[str, int], tuple[list[Piece], list[float]]] = {}
    before = dict.fromkeys(totals, 0.0)
    for piece, each in zip(pieces, prices, strict=True):
        law = piece.column.contact
        reached = before[law] + np.cumsum(each)
        last = max(0, int(totals[law] / work + 0.5) - 1)
        numbers = np.minimum(((reached - each / 2) / work).astype(np.int64), last)
        for number, part in _runs_of(piece, numbers):
            held, taken = parts.setdefault((law, number), ([], []))
            held.append(part)
            taken.append(float(each[numbers == number].sum()))
        before[law] = float(reached[-1])
    for held, taken in parts.values():
        yield tuple(held), math.fsum(taken)


def _runs_of(piece: Piece, numbers: npt.NDArray[np.int64]) -> Iterator[tuple[int, Piece]]:
    """Yield a piece cut where its cells' numbers, ascending, change, each part with its number."""
    edges = [0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist(), len(piece.steps)]
    for start, end in pairwise(edges):
        yield int(numbers[start]), Piece(piece.column, piece.steps[start:end])


def _digest(sweep: Sweep, config: dict[str, Any], plan: Sequence[Any]) -> str:
    text = json.dumps([sweep.scene.digest, sweep.seed, config, plan], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]
