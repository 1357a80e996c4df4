"""The grid of a sweep: which stiffnesses, which steps are tried first and which between them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.model_selection import AS_ASKED
from stiffdice.dynamics.state import Array
from stiffdice.scene.scene import Scene
from stiffdice.simulation.backend import OURS
from stiffdice.simulation.criteria.apex import default_hop_height

# `count` values from `from` to `to`; several spans are all the values of each.
Span = Mapping[str, float]
Spans = Span | Sequence[Span]


class Column(NamedTuple):
    """One stiffness under one contact law: what a scan over steps is made for."""

    contact: str
    stiffness: float  # [kg/s²]


class Piece(NamedTuple):
    """Some cells of a column; steps: ascending."""

    column: Column
    steps: tuple[int, ...]


@dataclass(frozen=True, eq=False, kw_only=True)  # itself alone, so that its plan can be kept
class Sweep:
    """A grid of stiffness and steps.

    criteria: tolerances of those asked. early_stop: whether a run ends once all of them are decided. refine: how many
    times the scan is made twice as dense where members disagree. reach: if given, the first scan is every
    2^refine-th cell of the grid, and each later one halves that within this factor of steps about where they disagree.
    horizon [s]: until when `trajectory` compares. hop_height [m]: rebounds that stay lower are not judged by `apex`;
    a tenth of the cube's radius if none is given.
    model: the one computed; model_reason: why. simulator: what makes the runs; scheme: its own, if it is an engine.
    seconds_per_job: of predicted work that one job gets; None leaves it to `shards`.
    """

    scene: Scene
    model: str
    scheme: str
    contact: tuple[str, ...]
    stiffness: Spans
    steps: Spans | None = None
    omega_h: Spans | None = None
    members: int
    seed: int = 0
    refine: int = 0
    criteria: Mapping[str, float]
    early_stop: bool = True
    horizon: float
    seconds_per_job: float | None = None
    model_reason: str = AS_ASKED
    simulator: str = OURS
    reach: float | None = None
    hop_height: float | None = None

    def __post_init__(self) -> None:
        if self.hop_height is None:
            object.__setattr__(self, "hop_height", default_hop_height(self.scene))

    def scene_of(self, column: Column) -> Scene:
        """Return the sweep's scene on the ground of a column."""
        return self.scene.with_ground(contact=column.contact, stiffness=column.stiffness)

    def columns(self) -> list[Column]:
        """Return all columns: contact law by law, stiffness by stiffness, ascending."""
        stiffnesses = sorted({value for span in _each(self.stiffness) for value in geometric(span)})
        return [Column(contact, stiffness) for contact in self.contact for stiffness in stiffnesses]

    @property
    def _grid(self) -> Sequence[Span]:
        """The spans of steps, given as counts or as ωh."""
        grid = self.omega_h if self.steps is None else self.steps
        assert grid is not None, "the schema asks for one of them"
        return _each(grid)

    def step_range(self, stiffness: float) -> tuple[float, float]:
        """Return the fewest and the most steps of the grid at one stiffness [kg/s²], not rounded."""
        fewest, most = zip(*(self._range_of(span, stiffness) for span in self._grid), strict=True)
        return min(fewest), max(most)

    def _range_of(self, span: Span, stiffness: float) -> list[float]:
        ends = [float(span["from"]), float(span["to"])]  # NumPy has no whole numbers above 2^63
        if self.steps is None:
            radians = linear_theory.contact_frequency(stiffness, self.scene.cube.mass) * self.scene.duration
            ends = [radians / end for end in ends]
        return sorted(ends)

    def scan(self, column: Column) -> list[int]:
        """Return the step counts first tried in a column: spread evenly in their logarithm, jittered within each part.

        Round numbers are special (the step may be a whole fraction of everything else in a scene), so none is favoured.
        What a span scans does not depend on the others. With `reach` they are one in 2^refine of the grid's.
        """
        whole = self.whole_scan(column)
        return whole if self.reach is None else sorted({*whole[:: 2**self.refine], whole[-1]})

    def whole_scan(self, column: Column) -> list[int]:
        """Return all step counts of a column's grid, ascending; a sweep with `reach` tries some of them."""
        found = set[int]()
        for span in self._grid:
            low, high = np.log(self._range_of(span, column.stiffness))
            count = int(span["count"])
            part = (np.arange(count) + self._jitter(column, 0).random(count)) / count
            found |= {max(1, round(steps)) for steps in np.exp(low + (high - low) * part).tolist()}
        return sorted(found)

    def finer(self, column: Column, scanned: Sequence[int], passing: Array, rounds: int) -> list[int]:
        """Return step counts to add to a scan: one between any two neighbours whose members do not all agree.

        scanned: ascending. passing: share of members that pass, shape (criterion, scan). rounds: how many were before.
        """
        clear = (passing[:, 1:] == passing[:, :-1]) & ((passing[:, 1:] == 0) | (passing[:, 1:] == 1))
        unclear = np.flatnonzero(~clear.all(axis=0))
        places = np.log(scanned)
        low, high = places[:-1], places[1:]
        if self.reach is None:
            place = 0.25 + 0.5 * self._jitter(column, rounds).random(len(unclear))
            between = np.exp(low[unclear] + (high[unclear] - low[unclear]) * place)
            return sorted({round(steps) for steps in between.tolist()} - set(scanned))
        # One in 2^(refine − rounds) of the grid's cells wherever neighbours lie within reach of unclear ones: even two
        # that both have all passing may there have a cell between them that fails.
        reach, whole = np.log(self.reach), self.whole_scan(column)
        near = (high[:, None] >= low[unclear] - reach) & (low[:, None] <= high[unclear] + reach)
        index, stride = np.searchsorted(whole, scanned), 2 ** (self.refine - rounds)
        starts = np.flatnonzero(near.any(axis=1))
        return sorted({whole[k] for i in starts for k in range(index[i], index[i + 1], stride)} - set(scanned))

    def _jitter(self, column: Column, rounds: int) -> np.random.Generator:
        key = int.from_bytes(hashlib.sha256(repr(column.stiffness).encode()).digest()[:8])
        return np.random.default_rng([self.seed, key, rounds] if rounds else [self.seed, key])

    @property
    def of_runs(self) -> dict[str, Any]:
        """What a run depends on besides its cell, the scene and the code, as plain data."""
        names = ["model", "model_reason", "simulator", "scheme", "members", "hop_height"]
        names += ["horizon"] if "trajectory" in self.criteria else []
        config = {name: getattr(self, name) for name in names}
        # Other tolerances need other runs only where a run stops because of them.
        return config | ({"criteria": dict(self.criteria), "early_stop": True} if self.early_stop else {})

    @property
    def of_cells(self) -> dict[str, Any]:
        """What the places of cells depend on besides columns, scene and code: by themselves, and by what was found."""
        spans = [dict(span) for span in self._grid]
        grid: dict[str, Any] = {"omega_h" if self.steps is None else "steps": spans if len(spans) > 1 else spans[0]}
        if self.reach is not None:  # every round's cells then depend on how many rounds there are
            grid |= {"refine": self.refine, "reach": self.reach}
        return self.of_runs | grid | {"seed": self.seed, "criteria": dict(self.criteria), "early_stop": self.early_stop}

    @property
    def config(self) -> dict[str, Any]:
        """What the runs of all columns depend on besides the scene and the code, as plain data."""
        config = self.of_cells | {"refine": self.refine}
        if not (self.early_stop or self.refine):  # the tolerances then place no cell, and stop no run
            del config["criteria"], config["early_stop"]
        return config


def _each(spans: Spans) -> Sequence[Span]:
    return [spans] if isinstance(spans, Mapping) else spans


def geometric(span: Mapping[str, float]) -> list[float]:
    """Return `count` values from `from` to `to`, evenly spaced in their logarithm, the ends exact.

    Rounded to twelve digits: 1000, not 999.9999999999998, names a cell.
    """
    values = np.geomspace(float(span["from"]), float(span["to"]), int(span["count"]))
    return [float(f"{value:.12g}") for value in values]
