"""Compute the columns of one shard and store their runs."""

from typing import Any

from job import Stopwatch, logged, tenths

from stiffdice import job_log, sweep

snakemake: Any  # Snakemake puts it here

with logged() as say:
    planned, watch = snakemake.params.sweep, Stopwatch()
    with watch.running():
        cells = sweep.compute(planned, snakemake.params.columns, snakemake.output[0], tenths(say))
    say(job_log.cells(cells, planned.members))
    say(f"simulation: {watch.seconds:.3f} s")
