"""The grid of a sweep: which stiffnesses, which steps are tried first and which between them, and who computes what."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from stiffdice import theory
from stiffdice.requirement import AS_ASKED
from stiffdice.scene import Scene
from stiffdice.simulators import OURS
from stiffdice.state import Array


class Column(NamedTuple):
    """One stiffness under one contact law: what a scan over steps is made for."""

    contact: str
    stiffness: float  # [kg/s²]


@dataclass(frozen=True)
class Sweep:
    """A grid of stiffness and steps, in shards.

    criteria: tolerances of those asked. early_stop: whether a run ends once all of them are decided. refine: how many
    times the scan is made twice as dense where members disagree. horizon [s]: until when `trajectory` compares.
    model: the one computed; model_reason: why. simulator: what makes the runs; scheme: its own, if it is an engine.
    """

    scene: Scene
    model: str
    scheme: str
    contact: tuple[str, ...]
    stiffness: Mapping[str, float]
    steps: Mapping[str, float] | None
    omega_h: Mapping[str, float] | None
    members: int
    seed: int
    refine: int
    criteria: Mapping[str, float]
    early_stop: bool
    horizon: float
    columns_per_shard: int
    model_reason: str = AS_ASKED
    simulator: str = OURS

    def scene_of(self, column: Column) -> Scene:
        """Return the sweep's scene on the ground of a column."""
        return self.scene.with_ground(contact=column.contact, stiffness=column.stiffness)

    def columns(self) -> list[Column]:
        """Return all columns: contact law by law, stiffness by stiffness."""
        stiffnesses = dict.fromkeys(geometric(self.stiffness))
        return [Column(contact, stiffness) for contact in self.contact for stiffness in stiffnesses]

    @property
    def _grid(self) -> Mapping[str, float]:
        """The span of steps, given as counts or as ωh."""
        grid = self.omega_h if self.steps is None else self.steps
        assert grid is not None, "the schema asks for one of them"
        return grid

    def step_range(self, stiffness: float) -> tuple[float, float]:
        """Return the fewest and the most steps of the grid at one stiffness [kg/s²], not rounded."""
        ends = self._grid
        if self.steps is None:
            scene = self.scene.with_ground(stiffness=stiffness)
            ends = {end: theory.steps_for(scene, ends[end]) for end in ("from", "to")}
        first, last = float(ends["from"]), float(ends["to"])  # NumPy has no whole numbers above 2^63
        return min(first, last), max(first, last)

    def scan(self, column: Column) -> list[int]:
        """Return the step counts first tried in a column: spread evenly in their logarithm, jittered within each part.

        Round numbers are special (the step may be a whole fraction of everything else in a scene), so none is favoured.
        """
        low, high = np.log(self.step_range(column.stiffness))
        count = int(self._grid["count"])
        part = (np.arange(count) + self._jitter(column, 0).random(count)) / count
        return sorted({max(1, round(float(steps))) for steps in np.exp(low + (high - low) * part)})

    def finer(self, column: Column, scanned: Sequence[int], passing: Array, rounds: int) -> list[int]:
        """Return step counts to add to a scan: one between any two neighbours whose members do not all agree.

        scanned: ascending. passing: share of members that pass, shape (criterion, scan). rounds: how many were before.
        """
        clear = (passing[:, 1:] == passing[:, :-1]) & ((passing[:, 1:] == 0) | (passing[:, 1:] == 1))
        unclear = np.flatnonzero(~clear.all(axis=0)).tolist()
        place = 0.25 + 0.5 * self._jitter(column, rounds).random(len(unclear))
        low, high = np.log([scanned[k] for k in unclear]), np.log([scanned[k + 1] for k in unclear])
        added = {round(float(steps)) for steps in np.exp(low + (high - low) * place)}
        return sorted(added - set(scanned))

    def _jitter(self, column: Column, rounds: int) -> np.random.Generator:
        key = int.from_bytes(hashlib.sha256(repr(column.stiffness).encode()).digest()[:8])
        return np.random.default_rng([self.seed, key, rounds] if rounds else [self.seed, key])

    def shards(self) -> dict[str, list[Column]]:
        """Return the columns of each shard, by the shard's id: a digest of all that its numbers depend on but the code.

        Columns are dealt out in turn, so that every shard gets its share of the expensive ones.
        """
        columns = self.columns()
        count = -(-len(columns) // self.columns_per_shard)
        return {self._digest(columns[k::count]): columns[k::count] for k in range(count)}

    @property
    def config(self) -> dict[str, Any]:
        """What the runs of a column depend on besides its ground, the scene and the code, as plain data."""
        config: dict[str, Any] = {
            "model": self.model,
            "model_reason": self.model_reason,
            "simulator": self.simulator,
            "scheme": self.scheme,
            "members": self.members,
            "seed": self.seed,
            "refine": self.refine,
            "omega_h" if self.steps is None else "steps": dict(self._grid),
        }
        if "trajectory" in self.criteria:
            config["horizon"] = self.horizon
        # Other tolerances need other runs only where a run stops, or a scan is refined, because of them.
        if self.early_stop or self.refine:
            config |= {"criteria": dict(self.criteria), "early_stop": self.early_stop}
        return config

    def _digest(self, columns: Sequence[Column]) -> str:
        plan = [self.scene.digest, self.config, columns]
        return hashlib.sha256(json.dumps(plan, sort_keys=True).encode()).hexdigest()[:12]


def geometric(span: Mapping[str, float]) -> list[float]:
    """Return `count` values from `from` to `to`, evenly spaced in their logarithm, the ends exact.

    Rounded to twelve digits: 1000, not 999.9999999999998, names a cell.
    """
    values = np.geomspace(float(span["from"]), float(span["to"]), int(span["count"]))
    return [float(f"{value:.12g}") for value in values]
