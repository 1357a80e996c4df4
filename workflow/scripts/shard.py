"""Compute the columns of one shard and store their runs."""

from typing import Any

from job import Stopwatch, logged, tenths

from stiffdice import sweep

snakemake: Any  # Snakemake puts it here

with logged(snakemake.log[0]) as say:
    watch = Stopwatch()
    with watch.running():
        sweep.compute(snakemake.params.sweep, snakemake.params.columns, snakemake.output[0], tenths(say))
    say(f"simulation: {watch.seconds:.3f} s")
