"""Make one timing and store the times."""

from typing import Any

from job import Stopwatch, logged

from stiffdice import scene as scenes
from stiffdice.catalogue import TIMINGS
from stiffdice.errors import InputError
from stiffdice.io.write import write_dataset

snakemake: Any  # Snakemake puts it here

planned = snakemake.params.experiment
with logged(snakemake.log[0]) as say:
    scene = scenes.load(planned.scene, planned.changes)
    watch = Stopwatch()
    with watch.running():
        try:
            found = TIMINGS[planned.measure].load()(scene, **planned.options)
        except InputError as error:
            where = f"config/{snakemake.wildcards.study}.yaml: timings.{snakemake.wildcards.timing}.options"
            raise error.within(where) from None
    write_dataset(found, snakemake.output[0])
    say(f"simulation: {watch.seconds:.3f} s")
