"""Run one scene and store its trajectory, with the ledger of its energy."""

from typing import Any

from job import Stopwatch, logged

from stiffdice.io.writer import write_dataset
from stiffdice.scene import scene as scenes
from stiffdice.simulation import energy_budget
from stiffdice.simulation.backend import OURS
from stiffdice.simulation.dataset import run_dataset
from stiffdice.simulation.run import simulate

snakemake: Any  # Snakemake puts it here

planned, preset = snakemake.params.run, snakemake.wildcards.preset
with logged() as say:
    scene = scenes.load(planned.scene, preset=preset)
    watch = Stopwatch()
    with watch.running():
        run = simulate(
            scene,
            model=planned.model,
            simulator=planned.simulator,
            scheme=planned.scheme,
            steps=planned.steps,
            every=planned.every,
        )
        dataset = run_dataset(run, f"{snakemake.wildcards.run}, {preset.replace('_', ' ')}")
        if planned.simulator == OURS and planned.scheme in energy_budget.BOOKED:
            ledger = energy_budget.ledger(scene, model=run.model, scheme=planned.scheme, steps=planned.steps)
            dataset = dataset.assign(ledger.data_vars)
    write_dataset(dataset, snakemake.output[0])
    say(f"simulation: {watch.seconds:.3f} s")
