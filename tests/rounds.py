"""Sweeps computed as the workflow computes them: round by round, shard by shard."""

from __future__ import annotations

import dataclasses
import math
import tempfile
from pathlib import Path
from typing import Any

import xarray as xr
import yaml

from stiffdice.io.reader import parts
from stiffdice.study import config as study
from stiffdice.sweep import partition
from stiffdice.sweep.collect import collect
from stiffdice.sweep.grid import Column, Piece, Sweep
from stiffdice.sweep.shard import compute_shard

ROOT = Path(__file__).parent.parent


def scan(plan: Sweep, columns: list[Column] | None = None) -> list[Piece]:
    """Return the cells that a sweep scans first in some of its columns, or in all."""
    return [Piece(column, tuple(plan.scan(column))) for column in (plan.columns() if columns is None else columns)]


def judged(plan: Sweep, paths: list[Path]) -> xr.Dataset:
    """Return what shards add up to."""
    return collect((part for path in paths for part in parts(path)), plan.criteria)


def compute(plan: Sweep, folder: Path) -> list[Path]:
    """Compute all shards of all rounds into a folder, and return their files."""
    made: list[Path] = []
    for number in range(plan.refine + 1):
        due = partition.rounds(partition.of(plan), number)
        cells = [shard.pieces for shard in due.values()]
        if number:
            cells = partition.later(plan, judged(plan, made), number)
        for name, pieces in zip(due, cells, strict=True):
            made.append(folder / f"{name}.h5")
            compute_shard(plan, pieces, made[-1])
    return made


def by_columns(plan: Sweep, size: int, folder: Path) -> list[Path]:
    """Compute files of so many whole columns each, dealt out in turn, as no plan of today does."""
    columns = plan.columns()
    count = -(-len(columns) // size)
    made = [folder / f"{k:012x}.h5" for k in range(count)]
    for k, path in enumerate(made):
        compute_shard(plan, scan(plan, columns[k::count]), path)
    return made


def in_parts(plan: Sweep, count: float) -> Sweep:
    """Return the sweep with jobs of such a length that its first round has about so many."""
    work = math.fsum(shard.seconds for shard in partition.of(plan).values() if not shard.round)
    return dataclasses.replace(plan, seconds_per_job=work / count * (1 + 1e-9))


def asked_in_parts(asked: dict[str, Any], count: float) -> dict[str, Any]:
    """Return the same for a sweep as a study's file asks for it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.yaml"
        scene = {"scene": str(ROOT / asked["scene"])}
        path.write_text(yaml.safe_dump({"question": "How long?", "sweeps": {"x": {**asked, **scene}}}))
        plan = study.load(path).sweeps["x"]
    return {**asked, "seconds_per_job": in_parts(plan, count).seconds_per_job}
