"""Find the edges of stability in a collected sweep."""

from typing import Any

from inputs import opened
from job import logged

from stiffdice import frontier
from stiffdice.io.write import write_bytes, write_dataset

snakemake: Any  # Snakemake puts it here

with logged() as say:
    found = frontier.find(opened(snakemake.input.items(), say)["sweep"])
    write_dataset(found, snakemake.output.data)
    write_bytes(frontier.table(found).encode(), snakemake.output.table)
    say(f"{found.sizes['stiffness']} stiffnesses, {found.sizes['criterion']} criteria")
