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
    timings of that kind besides. on_its_ground: whether an experiment takes the scene's ground as it is, so that it may
    be given by its restitution.
    """

    module: str
    function: str
    given: str = ""
    measures: str = ""
    timed: bool = False
    on_its_ground: bool = False

    def load(self) -> Callable[..., Any]:
        """Return the function."""
        return getattr(importlib.import_module(self.module), self.function)


_COMPARED, _TOLD = "stiffdice.report.figures.methods", "stiffdice.report.tables.methods"
_TOSSES, _TOSSES_TOLD = "stiffdice.report.figures.tosses", "stiffdice.report.tables.tosses"

# (datasets by name, title) -> a figure.
DRAWINGS: dict[str, Entry] = {
    "cube-start": Entry("stiffdice.report.figures.runs", "start", "runs"),
    "cube-middle": Entry("stiffdice.report.figures.runs", "middle", "runs"),
    "cube-end": Entry("stiffdice.report.figures.runs", "end", "runs"),
    "animation": Entry("stiffdice.report.figures.runs", "animation", "runs"),
    "position": Entry("stiffdice.report.figures.runs", "position", "runs"),
    "energy": Entry("stiffdice.report.figures.runs", "energy", "runs"),
    "frontier": Entry("stiffdice.report.figures.stability", "steps_needed", "sweeps"),
    "stability-map": Entry("stiffdice.report.figures.stability", "stability_map", "sweeps"),
    "pass-fraction": Entry("stiffdice.report.figures.stability", "pass_fraction", "sweeps"),
    "refinement-check": Entry("stiffdice.report.figures.refinement_check", "draw", "sweeps"),
    "bounce-map": Entry("stiffdice.report.figures.bounces", "bounce_map", "experiments", "bounce-map"),
    "apex-edge": Entry("stiffdice.report.figures.bounces", "apex_edge", "experiments", "apex-edge"),
    "rocking": Entry("stiffdice.report.figures.resting", "rocking", "experiments", "rocking"),
    "energy-budget": Entry("stiffdice.report.figures.bounces", "energy_budget", "experiments", "energy-budget"),
    "failure-map": Entry("stiffdice.report.figures.failure_map", "draw", "experiments", "failure-map"),
    "friction-chatter": Entry("stiffdice.report.figures.resting", "chatter", "experiments", "friction-chatter"),
    "model-ablation": Entry("stiffdice.report.figures.model_ablation", "draw", "experiments", "model-ablation"),
    "held-contacts": Entry("stiffdice.report.figures.resting", "held_contacts", "experiments", "held-contacts"),
    "toss-steps": Entry(_TOSSES, "steps", "experiments", "toss-steps"),
    "toss-time": Entry(_TOSSES, "over_time", "experiments", "toss-models"),
    "toss-fit": Entry(_TOSSES, "fit", "experiments", "toss-fit"),
    "toss-chaos": Entry(_TOSSES, "chaos", "experiments", "toss-chaos"),
    "toss-animation": Entry(_TOSSES, "animation", "experiments", "toss"),
    "work-precision": Entry(_COMPARED, "position", "experiments", "work-precision", timed=True),
    "work-restitution": Entry(_COMPARED, "restitution", "experiments", "work-precision", timed=True),
    "work-energy": Entry(_COMPARED, "energy", "experiments", "work-precision", timed=True),
    "cost": Entry(_COMPARED, "cost_position", "experiments", "work-precision", timed=True),
    "cost-restitution": Entry(_COMPARED, "cost_restitution", "experiments", "work-precision", timed=True),
    "cost-energy": Entry(_COMPARED, "cost_energy", "experiments", "work-precision", timed=True),
    "faces": Entry("stiffdice.report.figures.landing", "faces", "experiments", "landing"),
    "coarse-steps": Entry("stiffdice.report.figures.landing", "coarse_steps", "experiments", "coarse-steps"),
    "pair-limits": Entry("stiffdice.report.figures.pair.limits", "draw", "experiments", "pair-limits"),
    "pair-outcomes": Entry("stiffdice.report.figures.pair.outcomes", "draw", "experiments", "pair-outcomes"),
    "granular-impacts": Entry("stiffdice.report.figures.granular", "impacts", "experiments", "granular-impacts"),
    "engine-limits": Entry(_COMPARED, "engine_limits", "experiments", "engine-limits"),
    "engine-throw": Entry(_COMPARED, "engine_throw", "experiments", "engine-throw"),
    "engine-speed": Entry(_COMPARED, "engine_speed", "timings", "engine-speed"),
    "box-faces": Entry("stiffdice.report.figures.dice", "ends", "experiments", "box-faces"),
    "face-response": Entry("stiffdice.report.figures.dice", "response", "experiments", "face-response"),
    "launch-response": Entry("stiffdice.report.figures.dice", "launches", "experiments", "launch-response"),
    "pair-peers": Entry("stiffdice.report.figures.pair.peers", "draw", "experiments", "pair-peers"),
    "model-ablation-time": Entry("stiffdice.report.figures.model_ablation", "draw_times", "timings", "model-ablation"),
}

# (datasets by name, title) -> a table.
TABLES: dict[str, Entry] = {
    "paper-questions": Entry("stiffdice.report.tables.sweeps", "paper_questions", "sweeps"),
    "refinement-check": Entry("stiffdice.report.tables.sweeps", "refinement_check", "sweeps"),
    "precision-limits": Entry("stiffdice.report.tables.precision_limits", "table", "experiments", "precision-limits"),
    "work-precision": Entry(_TOLD, "work_precision", "experiments", "work-precision", timed=True),
    "engine-contact": Entry(_TOLD, "engine_contact", "experiments", "engine-contact"),
    "engine-limits": Entry(_TOLD, "engine_limits", "experiments", "engine-limits"),
    "pair-limits": Entry("stiffdice.report.tables.pair", "limits", "experiments", "pair-limits"),
    "pair-outcomes": Entry("stiffdice.report.tables.pair", "outcomes", "experiments", "pair-outcomes"),
    "pair-orders": Entry("stiffdice.report.tables.pair", "orders", "experiments", "pair-orders"),
    "granular-steps": Entry("stiffdice.report.tables.granular", "steps", "experiments", "granular-steps"),
    "granular-beads": Entry("stiffdice.report.tables.granular", "beads", "experiments", "granular-beads"),
    "engine-speed": Entry(_TOLD, "engine_speed", "timings", "engine-speed"),
    "toss-fit": Entry(_TOSSES_TOLD, "fit", "experiments", "toss-fit"),
    "toss-models": Entry(_TOSSES_TOLD, "models", "experiments", "toss-models"),
    "toss-steps": Entry(_TOSSES_TOLD, "steps", "experiments", "toss-steps"),
    "toss-chaos": Entry(_TOSSES_TOLD, "chaos", "experiments", "toss-chaos"),
    "face-response": Entry("stiffdice.report.tables.dice", "response", "experiments", "face-response"),
    "response-checks": Entry("stiffdice.report.tables.dice", "checks", "experiments", "response-checks"),
    "pair-peers": Entry("stiffdice.report.tables.pair_peers", "table", "experiments", "pair-peers"),
    "targets": Entry(_TOLD, "targets", "experiments", "work-precision", timed=True),
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
    "landing": Entry("stiffdice.experiments.dice.landing", "measure", on_its_ground=True),
    "coarse-steps": Entry("stiffdice.experiments.dice.coarse_steps", "measure", on_its_ground=True),
    "box-faces": Entry("stiffdice.experiments.dice.shapes", "measure"),
    "face-response": Entry("stiffdice.experiments.dice.response", "measure"),
    "launch-response": Entry("stiffdice.experiments.dice.response", "launches"),
    "response-checks": Entry("stiffdice.experiments.dice.response", "checks"),
    "work-precision": Entry("stiffdice.experiments.work_precision.measure", "measure"),
    "toss": Entry("stiffdice.experiments.tosses.single", "measure"),
    "toss-fit": Entry("stiffdice.experiments.tosses.fit", "measure"),
    "toss-models": Entry("stiffdice.experiments.tosses.models", "measure"),
    "toss-steps": Entry("stiffdice.experiments.tosses.steps", "measure"),
    "toss-chaos": Entry("stiffdice.experiments.tosses.chaos", "measure"),
    "pair-limits": Entry("stiffdice.experiments.pair.limits", "measure"),
    "pair-outcomes": Entry("stiffdice.experiments.pair.outcomes", "measure"),
    "pair-orders": Entry("stiffdice.experiments.pair.orders", "measure"),
    "granular-steps": Entry("stiffdice.experiments.granular", "steps"),
    "granular-impacts": Entry("stiffdice.experiments.granular", "impacts"),
    "granular-beads": Entry("stiffdice.experiments.granular", "beads"),
    "engine-contact": Entry("stiffdice.experiments.engines", "contact"),
    "engine-limits": Entry("stiffdice.experiments.engines", "limits"),
    "engine-throw": Entry("stiffdice.experiments.engines", "throw"),
    "pair-peers": Entry("stiffdice.experiments.pair.peers", "measure"),
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
