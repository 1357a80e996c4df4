"""Collect shards into one sweep of judged cells, with a table that says what is in which; or those of some rounds."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from job import Job, Say, begin

if TYPE_CHECKING:
    import xarray as xr

_HEAD = "shard,round,cells,members,stiffness_from_kg_s-2,stiffness_to_kg_s-2,steps_from,steps_to"


def make(job: Job, say: Say) -> None:
    """Judge the cells of all shards and store them."""
    from stiffdice.io.writer import write_bytes, write_dataset
    from stiffdice.sweep.collect import collect

    asked, lines = job.plan(), [_HEAD]
    found = collect(_checked(job, lines, say), asked.criteria, asked.config)
    write_dataset(found, job.output[0])
    for table in job.output[1:]:  # a survey has none
        write_bytes(("\n".join(lines) + "\n").encode(), table)
    say(f"{len(lines) - 1} shards collected")


def _checked(job: Job, lines: list[str], say: Say) -> "Iterator[xr.Dataset]":
    """Read one shard after another, part by part, and note what is in it; one that is not as planned is refused."""
    from inputs import Inputs, opened

    from stiffdice.io.reader import parts
    from stiffdice.sweep import partition
    from stiffdice.sweep.shard import checked_shard

    asked, inputs = job.plan(), Inputs(say)
    plan = partition.of(asked)
    surveys = opened(((Path(path).stem, path) for path in job.input["surveys"]), say)
    later = {int(number) + 1: partition.later(asked, part, int(number) + 1) for number, part in surveys.items()}
    for path in job.input["shards"]:
        shard = plan[Path(path).stem]
        pieces = later[shard.round][shard.part] if shard.round else shard.pieces
        with inputs.reading(path):
            stiffness, steps = [], []
            for part in checked_shard(parts(path), asked, pieces):
                stiffness += part.stiffness.values.tolist()
                steps += part.steps.values.tolist()
                if inputs.whole:
                    yield part
            lines.append(_row(Path(path).stem, shard.round, asked.members, stiffness, steps))
    inputs.check()


def _row(name: str, number: int, members: int, stiffness: list[float], steps: list[int]) -> str:
    """Return what is in a shard as a line; a later round's may be empty."""
    spans = [f"{edge:g}" for edge in (min(stiffness), max(stiffness))] if steps else ["", ""]
    spans += [str(edge) for edge in (min(steps), max(steps))] if steps else ["", ""]
    return ",".join([name, str(number), str(len(steps)), str(members), *spans])


if __name__ == "__main__":
    begin(__file__, globals()["snakemake"])
