"""What a study may ask for by name: drawings, tables, experiments and timings. One line registers one.

They are named by module and function, not imported: reading a study must not wait for a plotting library.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple


class Entry(NamedTuple):
    """Where a function is, and what it is given.

    given: `runs`, `sweeps`, `experiments` or `timings`; the last two of the kind `measures`. timed: whether it takes
    timings of that kind besides.
    """

    module: str
    function: str
    given: str = ""
    measures: str = ""
    timed: bool = False

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
    "elastic": Entry(f"{_FIGURES}.elastic", "draw", "sweeps"),
    "bounce-map": Entry(f"{_FIGURES}.bounce_map", "draw", "experiments", "bounce-map"),
    "apex-edge": Entry(f"{_FIGURES}.apex_edge", "draw", "experiments", "apex-edge"),
    "rocking": Entry(f"{_FIGURES}.rocking", "draw", "experiments", "rocking"),
    "ledger": Entry(f"{_FIGURES}.ledger", "draw", "experiments", "ledger"),
    "atlas": Entry(f"{_FIGURES}.atlas", "draw", "experiments", "extremes"),
    "chatter": Entry(f"{_FIGURES}.chatter", "draw", "experiments", "chatter"),
    "pieces": Entry(f"{_FIGURES}.pieces", "draw", "experiments", "pieces"),
    "held": Entry(f"{_FIGURES}.held", "draw", "experiments", "held"),
    "work-precision": Entry(f"{_FIGURES}.work_precision", "position", "experiments", "work-precision", timed=True),
    "work-restitution": Entry(f"{_FIGURES}.work_precision", "restitution", "experiments", "work-precision", timed=True),
    "work-energy": Entry(f"{_FIGURES}.work_precision", "energy", "experiments", "work-precision", timed=True),
    "cost": Entry(f"{_FIGURES}.cost", "position", "experiments", "work-precision", timed=True),
    "cost-restitution": Entry(f"{_FIGURES}.cost", "restitution", "experiments", "work-precision", timed=True),
    "cost-energy": Entry(f"{_FIGURES}.cost", "energy", "experiments", "work-precision", timed=True),
    "engine-limits": Entry(f"{_FIGURES}.engine_limits", "draw", "experiments", "engine-limits"),
    "engine-throw": Entry(f"{_FIGURES}.engine_throw", "draw", "experiments", "engine-throw"),
    "engine-speed": Entry(f"{_FIGURES}.engine_speed", "draw", "timings", "engine-speed"),
    "pieces-time": Entry(f"{_FIGURES}.pieces", "draw_times", "timings", "pieces"),
}

# (datasets by name, title) -> a table.
TABLES: dict[str, Entry] = {
    "answers": Entry("stiffdice.answers", "table", "sweeps"),
    "elastic": Entry("stiffdice.elastic", "table", "sweeps"),
    "precision": Entry("stiffdice.precision", "table", "experiments", "precision"),
    "tradeoff": Entry("stiffdice.tradeoff", "table", "experiments", "work-precision", timed=True),
    "engine-contact": Entry("stiffdice.engine_tables", "contact", "experiments", "engine-contact"),
    "engine-limits": Entry("stiffdice.engine_tables", "limits", "experiments", "engine-limits"),
    "engine-speed": Entry("stiffdice.engine_tables", "speed", "timings", "engine-speed"),
    "targets": Entry("stiffdice.tradeoff", "targets", "experiments", "work-precision", timed=True),
}

# (scene, **options) -> a dataset; the function's keyword arguments are the options, with their defaults.
EXPERIMENTS: dict[str, Entry] = {
    "bounce-map": Entry("stiffdice.experiments.bounce_map", "measure"),
    "apex-edge": Entry("stiffdice.experiments.apex_edge", "measure"),
    "rocking": Entry("stiffdice.experiments.rocking", "measure"),
    "ledger": Entry("stiffdice.experiments.ledger", "measure"),
    "extremes": Entry("stiffdice.experiments.extremes", "measure"),
    "chatter": Entry("stiffdice.experiments.chatter", "measure"),
    "precision": Entry("stiffdice.experiments.precision", "measure"),
    "pieces": Entry("stiffdice.experiments.pieces", "measure"),
    "held": Entry("stiffdice.experiments.held", "measure"),
    "work-precision": Entry("stiffdice.experiments.work_precision", "measure"),
    "engine-contact": Entry("stiffdice.experiments.engine_contact", "measure"),
    "engine-limits": Entry("stiffdice.experiments.engine_limits", "measure"),
    "engine-throw": Entry("stiffdice.experiments.engine_throw", "measure"),
}

# (scene, **options) -> a dataset of times; they differ from one rebuild to the next, and nothing else runs meanwhile.
TIMINGS: dict[str, Entry] = {
    "work-precision": Entry("stiffdice.experiments.work_precision_time", "time"),
    "pieces": Entry("stiffdice.experiments.pieces", "time"),
    "engine-speed": Entry("stiffdice.experiments.engine_speed", "time"),
}


def showing_times(plan: object) -> set[str]:
    """Return which figures and tables of a study, as its file says, show timings: `figures/NAME`, `tables/NAME`."""
    found = set()
    for kind, word, registry in (("figures", "draw", DRAWINGS), ("tables", "tell", TABLES)):
        entries = plan.get(kind) if isinstance(plan, Mapping) else None
        for name, entry in entries.items() if isinstance(entries, Mapping) else ():
            if isinstance(entry, Mapping) and (entry.get("timings") or _draws_times(registry, entry.get(word))):
                found.add(f"{kind}/{name}")
    return found


def _draws_times(registry: Mapping[str, Entry], name: object) -> bool:
    return isinstance(name, str) and name in registry and registry[name].given == "timings"
