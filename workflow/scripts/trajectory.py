"""Run one scene and store its trajectory, with its energy budget."""

from job import Job, Say, Stopwatch, begin


def make(job: Job, say: Say) -> None:
    """Run the scene in one preset."""
    from stiffdice.io.writer import write_dataset
    from stiffdice.scene import scene as scenes
    from stiffdice.simulation import energy_budget
    from stiffdice.simulation.backend import OURS
    from stiffdice.simulation.dataset import plain_run_dataset
    from stiffdice.simulation.run import simulate

    planned, preset = job.plan(), job.wildcards["preset"]
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
        dataset = plain_run_dataset(run, f"{job.wildcards['run']}, {preset.replace('_', ' ')}")
        if planned.simulator == OURS and planned.scheme in energy_budget.BOOKED:
            ledger = energy_budget.ledger(scene, model=run.model, scheme=planned.scheme, steps=planned.steps)
            dataset = dataset.assign(ledger.data_vars)
    write_dataset(dataset, job.output[0])
    say(f"simulation: {watch.seconds:.3f} s")


if __name__ == "__main__":
    begin(__file__, globals()["snakemake"])
