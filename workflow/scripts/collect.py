"""Collect shards into one sweep of judged cells, with a table that says what is in which."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from inputs import Inputs, Say
from job import logged

from stiffdice import sweep
from stiffdice.io.read import parts
from stiffdice.io.write import write_bytes, write_dataset

snakemake: Any  # Snakemake puts it here

lines = ["shard,cells,members,stiffness_from_kg_s-2,stiffness_to_kg_s-2,steps_from,steps_to"]


def shards(say: Say) -> Iterator[xr.Dataset]:
    """Read one shard after another, part by part, and note what is in it; one that is not as planned is refused."""
    plan = snakemake.params.sweep
    planned, inputs = plan.shards(), Inputs(say)
    for path in snakemake.input:
        with inputs.reading(path):
            stiffness, steps, members = [], [], 0
            for part in sweep.checked(parts(path, sweep.AT_ONCE), plan, planned[Path(path).stem]):
                stiffness.append(part.stiffness.values)
                steps.append(part.steps.values)
                members = part.sizes["member"]
                if inputs.whole:
                    yield part
            softest_to_hardest, fewest_to_most = np.sort(np.concatenate(stiffness)), np.sort(np.concatenate(steps))
            lines.append(
                f"{Path(path).stem},{len(fewest_to_most)},{members},{softest_to_hardest[0]:g},"
                f"{softest_to_hardest[-1]:g},{fewest_to_most[0]},{fewest_to_most[-1]}"
            )
    inputs.check()


with logged() as say:
    write_dataset(sweep.collect(shards(say), snakemake.params.tolerances), snakemake.output.sweep)
    write_bytes(("\n".join(lines) + "\n").encode(), snakemake.output.table)
    say(f"{len(lines) - 1} shards collected")
