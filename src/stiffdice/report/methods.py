"""What methods are called, and which engines of which versions are in files."""

from __future__ import annotations

from collections.abc import Iterable

import xarray as xr

from stiffdice.io.cf_enums import meanings_of
from stiffdice.simulation.engines.registry import ENGINES, PEERS


def name_of(method: str) -> str:
    """Return a scheme's or an engine's name as a person reads it."""
    return PEERS[method].name if method in PEERS else method.replace("_", " ")


def engines_note(data: Iterable[xr.Dataset]) -> str:
    """Return the versions of the engines in files, and the names of those missing; nothing if they compare none."""
    data = list(data)
    methods = {name for found in data for name in meanings_of(found.method)}
    if not methods & set(ENGINES):
        return ""
    # All of SciPy's solvers are one package, and so are not missing beside each other.
    used = {PEERS[name].needs for name in methods if name in PEERS}
    missing = [engine.name for engine in ENGINES.values() if engine.needs not in used]
    versions = dict.fromkeys(
        part for found in data for part in str(found.attrs.get("engine_versions", "")).split("; ") if part
    )
    parts = [("Engines", versions), ("Left out or not installed", missing)]
    return " ".join(f"{what}: {', '.join(names)}." for what, names in parts if names)
