"""Which engines are in a file, of which versions, and which are not: a line for a figure's or a table's note."""

from __future__ import annotations

from collections.abc import Iterable

import xarray as xr

from stiffdice.io.cf_enums import meanings_of
from stiffdice.simulation.engines.registry import ENGINES, PEERS


def versions(data: Iterable[xr.Dataset]) -> str:
    """Return the versions of the engines in some files; nothing if there is none."""
    told = [part for found in data for part in str(found.attrs.get("engine_versions", "")).split("; ") if part]
    return ", ".join(dict.fromkeys(told))


def line(data: Iterable[xr.Dataset]) -> str:
    """Return the versions of the engines in some files, and the names of those missing; nothing if none was asked."""
    data = list(data)
    there = {name for found in data for name in meanings_of(found.method)}
    if not there & set(ENGINES):
        return ""
    loaded = {PEERS[name].load for name in there if name in PEERS}
    missing = [peer.name for peer in ENGINES.values() if peer.load not in loaded]
    told = versions(data)
    parts = [
        f"Engines: {told}." if told else "",
        f"Left out or not installed: {', '.join(missing)}." if missing else "",
    ]
    return " ".join(part for part in parts if part)
