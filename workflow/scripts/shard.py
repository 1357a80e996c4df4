"""Compute the cells of one shard and store them."""

from typing import Any

from job import Stopwatch, logged, tenths

from stiffdice import sweep
from stiffdice.io.write import write_dataset

snakemake: Any  # Snakemake puts it here

with logged(snakemake.log[0]) as say:
    watch = Stopwatch()
    with watch.running():
        shard = sweep.compute(snakemake.params.sweep, snakemake.params.cells, tenths(say))
    write_dataset(shard, snakemake.output[0])
    say(f"simulation: {watch.seconds:.3f} s")
