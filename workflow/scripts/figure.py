"""Draw one figure."""

from typing import Any

from job import logged

from stiffdice import figures
from stiffdice.io.read import open_file

snakemake: Any  # Snakemake puts it here

planned = snakemake.params.figure
with logged() as say:
    data = {name: open_file(path) for name, path in snakemake.input.items()}
    figures.draw(planned.draw, data, planned.title, snakemake.params.dpi, list(snakemake.output))
    say(f"{planned.draw} drawn")
