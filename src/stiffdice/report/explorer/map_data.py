"""The stability map: what stored sweeps say of every cell, for the page."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def collect(results: Path) -> dict[str, Any]:
    """Return the data of the map, JSON-able; empty where no study is stored.

    results: the folder in which studies lie, each under its name.
    """
    return {}
