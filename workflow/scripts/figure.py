"""Draw one figure."""

from typing import Any

from inputs import opened
from job import logged

from stiffdice.report.figures import registry as figures

snakemake: Any  # Snakemake puts it here

planned = snakemake.params.figure
with logged() as say:
    data = opened(snakemake.input.items(), say)
    figures.draw(planned.draw, data, planned.title, snakemake.params.dpi, list(snakemake.output))
    say(f"{planned.draw} drawn")
