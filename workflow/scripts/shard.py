"""Compute one shard and store its runs."""

from pathlib import Path
from typing import Any

from inputs import opened
from job import Stopwatch, logged, tenths

from stiffdice.study import job_log
from stiffdice.sweep import partition
from stiffdice.sweep.reuse import Kept
from stiffdice.sweep.shard import compute_shard

snakemake: Any  # Snakemake puts it here

with logged() as say:
    planned, target = snakemake.params.sweep, Path(snakemake.output[0])
    plan = partition.of(planned)
    number, part, _, pieces = plan[target.stem]
    if number:
        survey = opened([("survey", snakemake.input[0])], say)["survey"]
        pieces = partition.later(planned, survey, number)[part]
    kept = Kept(planned, pieces, target.parent, plan, say)
    watch = Stopwatch()
    with watch.running():
        cells = compute_shard(planned, pieces, target, tenths(say), kept)
    say(job_log.cells(cells, planned.members))
    if kept:
        say(f"of these, {len(kept)} cells kept from shards of an earlier plan")
    say(f"simulation: {watch.seconds:.3f} s")
