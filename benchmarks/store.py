"""Benchmarks in files: one file a bench, a variable a case, named by the time at which it was made."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from benchmarks.case import Case, Missing
from benchmarks.scenes import scene_of
from stiffdice.dynamics.state import Array
from stiffdice.io import schema
from stiffdice.simulation import dataset

# What a bench that is not all of it adds to its file's name; such a file is not what others are compared with.
QUICK, PART = "-quick", "-part"


def dataset_of(
    cases: Sequence[Case], missing: Sequence[Missing], samples: Array, machine: dict[str, Any]
) -> xr.Dataset:
    """Return what was measured: wall times of one `per` [s], a variable of dimension round for each case.

    samples: shape (case, round), as `rounds.measured` returns them. machine: the attributes that say what they were
    taken with.
    """
    variables = {case.name: ("round", samples[k], _attributes(case)) for k, case in enumerate(cases)}
    rounds = np.arange(samples.shape[1], dtype=np.int32)
    coordinates = {"round": ("round", rounds, schema.attributes_of("bench", "round"))}
    attributes = dataset.provenance_attributes(
        "Benchmark", scene_of("gated", 100_000), "case", "symplectic_euler", "stiffdice.simulation.run"
    )
    attributes |= dataset.config_attributes("bench", {"cases": [case.name for case in cases]}) | {
        "scene_note": "the throw; model, contact law and number of steps are those that the case names",
        "bench_code_digest": _source_digest(),
        "missing": "; ".join(f"{part.name}: {part.why}" for part in missing),
    }
    return xr.Dataset(variables, coordinates, attributes | machine)


def _source_digest() -> str:
    """Return a SHA-256 over the sources of the benchmarks."""
    digest = hashlib.sha256()
    for path in sorted(path for path in Path(__file__).parent.iterdir() if path.suffix in (".py", ".m")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def _attributes(case: Case) -> dict[str, Any]:
    attributes: dict[str, Any] = {
        "long_name": f"wall time of a {case.per}: {case.what}",
        "units": "s",
        "what": case.what,
        "per": case.per,
        "amount": float(case.amount),
        "limited_by": case.holds,
    }
    if case.flops:
        attributes["floating_point_operations"] = case.flops
    if case.chain:
        attributes["chain"] = " ".join(case.chain)
    if case.version:
        attributes["version"] = case.version
    return attributes


def path_for(folder: Path, kind: str = "") -> Path:
    """Return the name of the file of a bench that ends now; kind: "", QUICK or PART."""
    return folder / f"{time.strftime('%Y-%m-%dT%H%M%SZ', time.gmtime())}{kind}.h5"


def last_in(folder: Path, kind: str = "") -> Path | None:
    """Return the last stored bench that one of this kind is compared with: quick with quick, any other with whole."""
    return max(folder.glob(f"????-??-??T??????Z{QUICK if kind == QUICK else ''}.h5"), default=None)
