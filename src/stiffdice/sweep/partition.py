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
from itertools import groupby, pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.state import Array
from stiffdice.io.cf_enums import meanings_of
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.sweep import cost_model
from stiffdice.sweep.grid import Piece, Sweep

if TYPE_CHECKING:
    import xarray as xr

# Of predicted work: what a job gets [s], and what it gets of a sweep too small for so many jobs, but no less than that.
SECONDS, JOBS, FEWEST_SECONDS = 120.0, 16, 4.0

# Work of the second round over that of the first; each later one has twice as much as the one before it.
_FIRST_REFINEMENT = 0.5


class Shard(NamedTuple):
    """Cells that one job computes and one file holds: number `part` of a round, counted from 0.

    seconds: predicted work. pieces: its cells, known beforehand in the first round, number 0, only.
    """

    round: int
    part: int
    seconds: float
    pieces: tuple[Piece, ...] = ()


@lru_cache(maxsize=64)
def of(sweep: Sweep) -> Mapping[str, Shard]:
    """Return the shards of all rounds by their ids: digests of all that their numbers depend on but the code."""
    first = scan(sweep)
    costs = cost_model.of(sweep, first)
    total = float(np.cumsum(costs)[-1])
    work = sweep.seconds_per_job or max(FEWEST_SECONDS, min(SECONDS, total / JOBS))
    shards = {}
    for part, (pieces, seconds) in enumerate(_cut_at_multiples(first, costs, work)):
        shards[_digest(sweep, sweep.of_runs, pieces)] = Shard(0, part, seconds, pieces)
    columns = [piece.column for piece in first]
    expected, most = _FIRST_REFINEMENT * total, len(costs)
    for number in range(1, sweep.refine + 1):
        parts = max(1, min(math.ceil(expected / work), most))  # a round has fewer cells than those before it
        for part in range(parts):
            plan = [columns, number, part, parts]
            shards[_digest(sweep, sweep.of_cells, plan)] = Shard(number, part, expected / parts)
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
        law = list(CONTACT_LAWS).index(column.contact)
        first, end = np.searchsorted(contact, [law, law + 1])
        inside = stiffness[first:end]
        here = slice(*(first + np.searchsorted(inside, column.stiffness, side) for side in ("left", "right")))
        if due := sweep.finer(column, steps[here].tolist(), passing[:, here], number):
            pieces.append(Piece(column, tuple(due)))
    return pieces


def later(sweep: Sweep, survey: xr.Dataset, number: int) -> list[tuple[Piece, ...]]:
    """Return the cells of each shard of a later round; survey: of all rounds before it."""
    return share(sweep, refined(sweep, survey, number), len(rounds(of(sweep), number)))


def share(sweep: Sweep, pieces: Sequence[Piece], parts: int) -> list[tuple[Piece, ...]]:
    """Return the pieces cut into so many parts of equal predicted cost; some may be empty."""
    costs = cost_model.of(sweep, pieces)
    reached = np.cumsum(costs)
    numbers = ((reached - costs / 2) / reached[-1:] * parts).astype(np.int64)
    return _dealt(pieces, np.minimum(numbers, parts - 1), parts)


def _cut_at_multiples(pieces: Sequence[Piece], costs: Array, work: float) -> Iterator[tuple[tuple[Piece, ...], float]]:
    """Yield pieces in parts, each with its cost: a new one with every contact law, and whenever `work` more is done.

    What is left at the end of a law, if it is less than half of that, is done with the part before.
    """
    for _, of_law in groupby(pieces, lambda piece: piece.column.contact):
        here = list(of_law)
        seconds, costs = np.split(costs, [sum(len(piece.steps) for piece in here)])
        reached = np.cumsum(seconds)
        last = max(0.0, np.floor(reached[-1] / work + 0.5) - 1)
        multiples = np.fmin(np.floor((reached - seconds / 2) / work), last)
        _, numbers = np.unique(multiples, return_inverse=True)  # as many parts as cells, however dear these are
        dealt = _dealt(here, numbers, int(numbers[-1]) + 1)
        yield from zip(dealt, np.bincount(numbers, seconds).tolist(), strict=True)


def _dealt(pieces: Sequence[Piece], numbers: npt.NDArray[np.int64], parts: int) -> list[tuple[Piece, ...]]:
    """Return the pieces of each part; numbers: the part of each cell, ascending. A column may be cut."""
    found: list[list[Piece]] = [[] for _ in range(parts)]
    start = 0
    for column, steps in pieces:
        here = numbers[start : start + len(steps)]
        start += len(steps)
        edges = [0, *(np.flatnonzero(np.diff(here)) + 1).tolist(), len(steps)]
        for first, end in pairwise(edges):
            found[here[first]].append(Piece(column, steps[first:end]))
    return [tuple(part) for part in found]


def _digest(sweep: Sweep, config: dict[str, Any], plan: Sequence[Any]) -> str:
    text = json.dumps([sweep.scene.digest, sweep.seed, config, plan], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]
