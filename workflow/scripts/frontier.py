"""Find the edges of stability in a collected sweep."""

from typing import Any

from inputs import opened
from job import logged

from stiffdice.io.writer import write_bytes, write_dataset
from stiffdice.sweep import stability_limits

snakemake: Any  # Snakemake puts it here

with logged() as say:
    found = stability_limits.find(opened(snakemake.input.items(), say)["sweep"])
    write_dataset(found, snakemake.output.data)
    write_bytes(stability_limits.table(found).encode(), snakemake.output.table)
    say(f"{found.sizes['stiffness']} stiffnesses, {found.sizes['criterion']} criteria")
