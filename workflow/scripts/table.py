"""Tell what sweeps or experiments found as a table, for people and for programs."""

from typing import Any

from inputs import opened
from job import logged

from stiffdice.io.writer import write_bytes
from stiffdice.study.catalogue import TABLES

snakemake: Any  # Snakemake puts it here

planned = snakemake.params.table
with logged() as say:
    data = opened(snakemake.input.items(), say)
    table = TABLES[planned.draw].load()(data, planned.title)
    write_bytes(table.markdown.encode(), snakemake.output.markdown)
    write_bytes(table.csv.encode(), snakemake.output.csv)
    say(f"{planned.draw} told")
