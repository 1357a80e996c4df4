"""What a study may ask for by name: drawings, tables and experiments. One line registers one.

They are named by module and function, not imported: reading a study must not wait for a plotting library.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any, NamedTuple


class Entry(NamedTuple):
    """Where a function is, and what it is given: `runs`, `sweeps` or `experiments` (of the kind `measures`)."""

    module: str
    function: str
    given: str = ""
    measures: str = ""

    def load(self) -> Callable[..., Any]:
        """Return the function."""
        return getattr(importlib.import_module(self.module), self.function)


_FIGURES = "stiffdice.figures"

# (datasets by name, title) -> a figure.
DRAWINGS: dict[str, Entry] = {
    "cube-start": Entry(f"{_FIGURES}.cube", "start", "runs"),
    "cube-middle": Entry(f"{_FIGURES}.cube", "middle", "runs"),
    "cube-end": Entry(f"{_FIGURES}.cube", "end", "runs"),
    "animation": Entry(f"{_FIGURES}.cube", "animation", "runs"),
    "position": Entry(f"{_FIGURES}.trajectory", "position", "runs"),
    "energy": Entry(f"{_FIGURES}.trajectory", "energy", "runs"),
    "frontier": Entry(f"{_FIGURES}.frontier", "steps_needed", "sweeps"),
    "stability-map": Entry(f"{_FIGURES}.stability_map", "draw", "sweeps"),
    "comb": Entry(f"{_FIGURES}.comb", "draw", "sweeps"),
    "bounce-map": Entry(f"{_FIGURES}.bounce_map", "draw", "experiments", "bounce-map"),
    "rocking": Entry(f"{_FIGURES}.rocking", "draw", "experiments", "rocking"),
    "ledger": Entry(f"{_FIGURES}.ledger", "draw", "experiments", "ledger"),
    "atlas": Entry(f"{_FIGURES}.atlas", "draw", "experiments", "extremes"),
    "chatter": Entry(f"{_FIGURES}.chatter", "draw", "experiments", "chatter"),
    "pieces": Entry(f"{_FIGURES}.pieces", "draw", "experiments", "pieces"),
}

# (datasets by name, title) -> a table.
TABLES: dict[str, Entry] = {
    "answers": Entry("stiffdice.answers", "table", "sweeps"),
    "precision": Entry("stiffdice.precision", "table", "experiments", "precision"),
}

# (scene, **options) -> a dataset; the function's keyword arguments are the options, with their defaults.
EXPERIMENTS: dict[str, Entry] = {
    "bounce-map": Entry("stiffdice.experiments.bounce_map", "measure"),
    "rocking": Entry("stiffdice.experiments.rocking", "measure"),
    "ledger": Entry("stiffdice.experiments.ledger", "measure"),
    "extremes": Entry("stiffdice.experiments.extremes", "measure"),
    "chatter": Entry("stiffdice.experiments.chatter", "measure"),
    "precision": Entry("stiffdice.experiments.precision", "measure"),
    "pieces": Entry("stiffdice.experiments.pieces", "measure"),
}
