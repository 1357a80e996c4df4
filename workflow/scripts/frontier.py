"""Find the edges of stability in a collected sweep."""

from job import Job, Say, begin


def make(job: Job, say: Say) -> None:
    """Store the edges as data and as a table."""
    from inputs import opened

    from stiffdice.io.writer import write_bytes, write_dataset
    from stiffdice.sweep import stability_limits

    found = stability_limits.find(opened(job.input.items(), say)["sweep"])
    data, table = job.output
    write_dataset(found, data)
    write_bytes(stability_limits.table(found).encode(), table)
    say(f"{found.sizes['stiffness']} stiffnesses, {found.sizes['criterion']} criteria")


if __name__ == "__main__":
    begin(__file__, globals()["snakemake"])
