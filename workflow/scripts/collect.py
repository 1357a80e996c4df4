"""Collect shards into one sweep, with a table that says what is in which."""

from pathlib import Path
from typing import Any

from job import logged

from stiffdice import sweep
from stiffdice.errors import InputError
from stiffdice.io.read import open_file
from stiffdice.io.write import write_bytes, write_dataset

snakemake: Any  # Snakemake puts it here

with logged(snakemake.log[0]) as say:
    try:
        shards = [open_file(path) for path in snakemake.input]
    except InputError as error:
        raise InputError(f"{error}; remove the file, and the same command computes it again") from None
    lines = ["shard,cells,members,stiffness_from_kg_s-2,stiffness_to_kg_s-2,steps_from,steps_to"]
    for path, shard in zip(snakemake.input, shards, strict=True):
        sizes = f"{shard.sizes['cell']},{shard.sizes['member']}"
        stiffness, steps = shard.stiffness.values, shard.steps.values
        ranges = f"{stiffness.min():g},{stiffness.max():g},{steps.min()},{steps.max()}"
        lines.append(f"{Path(path).stem},{sizes},{ranges}")
    write_dataset(sweep.collect(shards), snakemake.output.sweep)
    write_bytes(("\n".join(lines) + "\n").encode(), snakemake.output.table)
    say(f"{len(shards)} shards collected")
