"""Make one experiment or one timing, and store what it found."""

from job import Job, Say, Stopwatch, begin, tenths


def make(job: Job, say: Say) -> None:
    """Measure as the study's file says."""
    from stiffdice.errors import InputError
    from stiffdice.io.writer import write_dataset
    from stiffdice.scene import scene as scenes
    from stiffdice.simulation.dataset import config_attributes
    from stiffdice.simulation.progress import told_to
    from stiffdice.study.catalogue import EXPERIMENTS, TIMINGS

    kind, planned = "timing" if "timing" in job.wildcards else "experiment", job.plan()
    scene = scenes.load(planned.scene, planned.changes)
    measure = {"experiment": EXPERIMENTS, "timing": TIMINGS}[kind][planned.measure].load()
    watch = Stopwatch()
    with watch.running(), told_to(tenths(say)):
        try:
            found = measure(scene, **planned.options)
        except InputError as error:
            where = f"config/{job.wildcards['study']}.yaml: {kind}s.{job.wildcards[kind]}.options"
            raise error.within(where) from None
    config = {"measure": planned.measure, "options": planned.options}
    write_dataset(found.assign_attrs(config_attributes(kind, config)), job.output[0])
    say(f"simulation: {watch.seconds:.3f} s")


if __name__ == "__main__":
    begin(__file__, globals()["snakemake"])
