"""Make one experiment or one timing, and store what it found."""

from typing import Any

from job import Stopwatch, logged

from stiffdice.errors import InputError
from stiffdice.io.writer import write_dataset
from stiffdice.scene import scene as scenes
from stiffdice.simulation.dataset import config_attributes
from stiffdice.study.catalogue import EXPERIMENTS, TIMINGS

snakemake: Any  # Snakemake puts it here

kind = snakemake.rule
planned = snakemake.params.experiment
with logged() as say:
    scene = scenes.load(planned.scene, planned.changes)
    measure = {"experiment": EXPERIMENTS, "timing": TIMINGS}[kind][planned.measure].load()
    watch = Stopwatch()
    with watch.running():
        try:
            found = measure(scene, **planned.options)
        except InputError as error:
            where = f"config/{snakemake.wildcards.study}.yaml: {kind}s.{snakemake.wildcards[kind]}.options"
            raise error.within(where) from None
    config = {"measure": planned.measure, "options": planned.options}
    write_dataset(found.assign_attrs(config_attributes(kind, config)), snakemake.output[0])
    say(f"simulation: {watch.seconds:.3f} s")
