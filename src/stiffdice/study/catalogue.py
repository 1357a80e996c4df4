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


_WORK, _TARGETS = "stiffdice.report.figures.work_precision", "stiffdice.report.tables.work_precision"

# (datasets by name, title) -> a figure.
DRAWINGS: dict[str, Entry] = {
    "cube-start": Entry("stiffdice.report.figures.cube", "start", "runs"),
    "cube-middle": Entry("stiffdice.report.figures.cube", "middle", "runs"),
    "cube-end": Entry("stiffdice.report.figures.cube", "end", "runs"),
    "animation": Entry("stiffdice.report.figures.cube", "animation", "runs"),
    "position": Entry("stiffdice.report.figures.trajectory", "position", "runs"),
    "energy": Entry("stiffdice.report.figures.trajectory", "energy", "runs"),
    "frontier": Entry("stiffdice.report.figures.stability.stability_limits", "steps_needed", "sweeps"),
    "stability-map": Entry("stiffdice.report.figures.stability.stability_map", "draw", "sweeps"),
    "pass-fraction": Entry("stiffdice.report.figures.stability.pass_fraction", "draw", "sweeps"),
    "refinement-check": Entry("stiffdice.report.figures.stability.refinement_check", "draw", "sweeps"),
    "bounce-map": Entry("stiffdice.report.figures.bounce_map", "draw", "experiments", "bounce-map"),
    "apex-edge": Entry("stiffdice.report.figures.stability.apex_edge", "draw", "experiments", "apex-edge"),
    "rocking": Entry("stiffdice.report.figures.rocking", "draw", "experiments", "rocking"),
    "energy-budget": Entry("stiffdice.report.figures.energy_budget", "draw", "experiments", "energy-budget"),
    "failure-map": Entry("stiffdice.report.figures.stability.failure_map", "draw", "experiments", "failure-map"),
    "friction-chatter": Entry("stiffdice.report.figures.friction_chatter", "draw", "experiments", "friction-chatter"),
    "model-ablation": Entry("stiffdice.report.figures.model_ablation", "draw", "experiments", "model-ablation"),
    "held-contacts": Entry("stiffdice.report.figures.held_contacts", "draw", "experiments", "held-contacts"),
    "work-precision": Entry(_WORK, "position", "experiments", "work-precision", timed=True),
    "work-restitution": Entry(_WORK, "restitution", "experiments", "work-precision", timed=True),
    "work-energy": Entry(_WORK, "energy", "experiments", "work-precision", timed=True),
    "cost": Entry(_WORK, "cost_position", "experiments", "work-precision", timed=True),
    "cost-restitution": Entry(_WORK, "cost_restitution", "experiments", "work-precision", timed=True),
    "cost-energy": Entry(_WORK, "cost_energy", "experiments", "work-precision", timed=True),
    "engine-limits": Entry("stiffdice.report.figures.engines.limits", "draw", "experiments", "engine-limits"),
    "engine-throw": Entry("stiffdice.report.figures.engines.throw", "draw", "experiments", "engine-throw"),
    "engine-speed": Entry("stiffdice.report.figures.engines.speed", "draw", "timings", "engine-speed"),
    "model-ablation-time": Entry("stiffdice.report.figures.model_ablation", "draw_times", "timings", "model-ablation"),
}

# (datasets by name, title) -> a table.
TABLES: dict[str, Entry] = {
    "paper-questions": Entry("stiffdice.report.tables.paper_questions", "table", "sweeps"),
    "refinement-check": Entry("stiffdice.report.tables.refinement_check", "table", "sweeps"),
    "precision-limits": Entry("stiffdice.report.tables.precision_limits", "table", "experiments", "precision-limits"),
    "work-precision": Entry(_TARGETS, "table", "experiments", "work-precision", timed=True),
    "engine-contact": Entry("stiffdice.report.tables.engines", "contact", "experiments", "engine-contact"),
    "engine-limits": Entry("stiffdice.report.tables.engines", "limits", "experiments", "engine-limits"),
    "engine-speed": Entry("stiffdice.report.tables.engines", "speed", "timings", "engine-speed"),
    "targets": Entry(_TARGETS, "targets", "experiments", "work-precision", timed=True),
}

# (scene, **options) -> a dataset; the function's keyword arguments are the options, with their defaults.
EXPERIMENTS: dict[str, Entry] = {
    "bounce-map": Entry("stiffdice.experiments.bounce_map", "measure"),
    "apex-edge": Entry("stiffdice.experiments.apex_edge", "measure"),
    "rocking": Entry("stiffdice.experiments.rocking", "measure"),
    "energy-budget": Entry("stiffdice.experiments.energy_budget", "measure"),
    "failure-map": Entry("stiffdice.experiments.failure_map", "measure"),
    "friction-chatter": Entry("stiffdice.experiments.friction_chatter", "measure"),
    "precision-limits": Entry("stiffdice.experiments.precision_limits", "measure"),
    "model-ablation": Entry("stiffdice.experiments.model_ablation", "measure"),
    "held-contacts": Entry("stiffdice.experiments.held_contacts", "measure"),
    "work-precision": Entry("stiffdice.experiments.work_precision.measure", "measure"),
    "engine-contact": Entry("stiffdice.experiments.engines", "contact"),
    "engine-limits": Entry("stiffdice.experiments.engines", "limits"),
    "engine-throw": Entry("stiffdice.experiments.engines", "throw"),
}

# (scene, **options) -> a dataset of times; they differ from one rebuild to the next, and nothing else runs meanwhile.
TIMINGS: dict[str, Entry] = {
    "work-precision": Entry("stiffdice.experiments.work_precision.measure", "time"),
    "model-ablation": Entry("stiffdice.experiments.model_ablation", "time"),
    "engine-speed": Entry("stiffdice.experiments.engines", "speed"),
}


def showing_times(plan: object) -> set[str]:
    """Return which figures and tables of a study, as its file says, show timings: `figures/NAME`, `tables/NAME`."""
    found = set()
    for kind, word, registry in (("figures", "draw", DRAWINGS), ("tables", "tell", TABLES)):
        timed = {name for name, entry in registry.items() if entry.given == "timings"}
        shown = plan.get(kind) if isinstance(plan, Mapping) else None
        for name, part in shown.items() if isinstance(shown, Mapping) else ():
            if isinstance(part, Mapping) and (part.get("timings") or str(part.get(word)) in timed):
                found.add(f"{kind}/{name}")
    return found
