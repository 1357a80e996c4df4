"""Many runs in one file: compute the cells of a shard, and check that a file holds those planned."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import TURNING
from stiffdice.errors import RefusedError
from stiffdice.io import schema
from stiffdice.io.content_digest import CELL
from stiffdice.io.shard_writer import CHUNK_CELLS, CHUNK_MEMBERS, Spool
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.simulation import backend, dataset
from stiffdice.simulation.criteria import registry as criteria
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.reference_run import references
from stiffdice.simulation.run import simulate
from stiffdice.sweep.grid import Column, Piece, Sweep

# What gives some members of a cell by name, shape (member, ...).
Known = Callable[[slice], Mapping[str, npt.NDArray[Any]]]

# What a shard keeps of each run besides the measures.
_OF_RUNS = ("touchdown_phase", "verdict", "ending", "steps_done", "steps_computed", "decided")

# Words of the enums of shards and sweeps.
MEANINGS = {"contact": list(CONTACT_LAWS), "verdict": dataset.VERDICTS, "ending": dataset.VERDICTS}

# Members computed together: their references are in memory together.
BLOCK = CHUNK_MEMBERS


def compute_shard(
    sweep: Sweep,
    pieces: Sequence[Piece],
    path: str | Path,
    progress: Callable[[float], None] | None = None,
    kept: Callable[[Column, int], Known | None] | None = None,
) -> int:
    """Compute one shard, store it (each run's measures and verdict, dimensions cell and member), and return its cells.

    What is in memory at a time is a block of members in some cells, whatever the size of the sweep. kept: runs that are
    there already. progress: called with about the fraction of the work done.
    """
    total, done = sum(sum(piece.steps) for piece in pieces), 0.0
    with Spool(path, shard_pattern(sweep)) as spool:
        for piece in pieces:
            steps = sum(piece.steps)
            for fraction in _compute_piece(sweep, piece, spool, kept):
                if progress is not None:
                    progress((done + fraction * steps) / total)
            done += steps
    return spool.cells


def _compute_piece(
    sweep: Sweep, piece: Piece, spool: Spool, kept: Callable[[Column, int], Known | None] | None
) -> Iterator[float]:
    """Store all members at each number of steps, computed where they are not kept; yield the fraction that is done."""
    scene, scan = sweep.scene_of(piece.column), piece.steps
    first = spool.add_cells(len(scan))
    spool.put(_cell_values(sweep, piece.column, scan), slice(first, first + len(scan)))
    there = [kept(piece.column, steps) if kept else None for steps in scan]
    launches = turned(scene, sweep.model, sweep.members)
    how: dict[str, Any] = {"simulator": sweep.simulator, "scheme": sweep.scheme, "hop_height": sweep.hop_height}
    asked: dict[str, Any] = {"criteria": sweep.criteria, "stop": sweep.criteria if sweep.early_stop else None}
    for start in range(0, sweep.members, BLOCK):
        block = slice(start, min(start + BLOCK, sweep.members))
        if "trajectory" in sweep.criteria and not all(there):
            distinct = launches[block] if sweep.model in TURNING else launches[:1]
            asked["references"], _ = references(scene, sweep.model, distinct, sweep.horizon)
        for batch in range(0, len(scan), CHUNK_CELLS):
            runs = []
            for steps, known in zip(scan[batch : batch + CHUNK_CELLS], there[batch:], strict=False):
                if known:
                    runs.append(known(block))
                    continue
                members = phased(scene, sweep.model, steps, sweep.members, launches, block)
                run = simulate(scene, model=sweep.model, steps=steps, members=members, **how, **asked)
                runs.append(run.measures | {name: getattr(run, name) for name in _OF_RUNS})
            cells = slice(first + batch, first + batch + len(runs))
            spool.put({name: np.stack([run[name] for run in runs]) for name in runs[0]}, cells, block)
            yield (start + (block.stop - start) * (batch + len(runs)) / len(scan)) / sweep.members


def _cell_values(sweep: Sweep, column: Column, scan: Sequence[int]) -> dict[str, Any]:
    scene = sweep.scene_of(column)
    return {
        "contact": np.full(len(scan), list(CONTACT_LAWS).index(column.contact), np.int8),
        "stiffness": np.full(len(scan), column.stiffness),
        "steps": np.array(scan, np.int64),
        "omega_h": np.array([linear_theory.omega_h(scene, steps) for steps in scan]),
    }


def shard_pattern(sweep: Sweep) -> xr.Dataset:
    """Return one cell with all names, types, units and attributes of the sweep's shards, and no values of its own."""
    sizes = {"cell": 1, "member": sweep.members, "criterion": len(criteria.CRITERIA)}
    values: dict[str, Any] = {
        name: (("cell", "member"), np.zeros((1, sweep.members)), attributes)
        for name, attributes in dataset.MEASURE_ATTRIBUTES.items()
    } | {
        name: np.zeros([sizes[dimension] for dimension in part.dimensions], part.type)
        for name, part in schema.KINDS["shard"].variables.items()
        if name not in dataset.MEASURE_ATTRIBUTES
    }
    values |= _cell_values(sweep, sweep.columns()[0], [1])
    values |= {name: np.arange(sizes[name], dtype=values[name].dtype) for name in ("member", "criterion")}
    attributes = _attributes(sweep, "Runs of a sweep of stiffness and steps")
    return schema.dataset("shard", values, MEANINGS | {"criterion": list(criteria.CRITERIA)}, attributes)


def _attributes(sweep: Sweep, title: str) -> dict[str, Any]:
    code = "stiffdice.sweep.shard", *backend.code_of(sweep.simulator)
    attributes = dataset.provenance_attributes(title, sweep.scene, sweep.model, sweep.scheme, *code)
    attributes |= dataset.simulator_attributes(sweep.simulator, backend.version_of(sweep.simulator))
    attributes |= dataset.config_attributes("shard", sweep.of_runs)
    attributes["seed"] = sweep.seed
    attributes["model_reason"] = sweep.model_reason
    attributes["scene_note"] = "contact law and stiffness are the cell's, not the scene's"
    attributes["early_stop"] = int(sweep.early_stop)
    if sweep.early_stop:  # otherwise the measures hold for any tolerances
        attributes["criteria"] = dataset.criteria_text(sweep.criteria)
    for name, unit in (("horizon", "s"), ("hop_height", "m")):
        if name in sweep.of_runs:
            attributes |= {name: sweep.of_runs[name], f"{name}_units": unit}
    return attributes


def checked_shard(parts: Iterable[xr.Dataset], sweep: Sweep, pieces: Sequence[Piece]) -> Iterator[xr.Dataset]:
    """Pass a shard on, part by part, if it is the one that `compute_shard` would make of these pieces now.

    Raises RefusedError, naming what is other than planned: attributes (code and scene among them), variables, members,
    or cells.
    """
    like = shard_pattern(sweep)
    scans = [len(piece.steps) for piece in pieces]
    planned = {
        "contact": np.repeat([list(CONTACT_LAWS).index(piece.column.contact) for piece in pieces], scans),
        "stiffness": np.repeat([piece.column.stiffness for piece in pieces], scans),
        "steps": np.array([steps for piece in pieces for steps in piece.steps]),
    }
    first = 0
    for part in parts:
        check_like(part, like)
        cells = slice(first, first + part.sizes["cell"])
        for name in CELL:
            if not np.array_equal(part[name].values, planned[name][cells]):
                raise RefusedError(f"not the shard planned: has cells of another {name}")
        first = cells.stop
        yield part
    if first < sum(scans):
        raise RefusedError("not the shard planned: cells are missing")


def differing(ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> list[str]:
    """Return the names of attributes that two files of runs do not share."""
    return [key for key in {**ours, **theirs} if str(ours.get(key)) != str(theirs.get(key))]


def check_like(part: xr.Dataset, pattern: xr.Dataset) -> None:
    """Raise RefusedError unless a part of a shard has the attributes and variables of a pattern."""
    if other := differing(pattern.attrs, part.attrs):
        raise RefusedError(f"not the shard planned: other {', '.join(other)}")
    for name in pattern.variables.keys() | part.variables.keys():
        kinds = {(data[name].dims, data[name].dtype) for data in (pattern, part) if name in data.variables}
        if len(kinds) > 1 or not (name in pattern.variables and name in part.variables):
            raise RefusedError(f"not the shard planned: other variable {name}")
    if part.sizes["member"] != pattern.sizes["member"]:
        raise RefusedError(f"not the shard planned: {part.sizes['member']} members, not {pattern.sizes['member']}")
