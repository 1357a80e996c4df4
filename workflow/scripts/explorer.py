"""Publish the explorer: one page for a browser, from the studies that are stored."""

from job import Job, Say, begin


def make(job: Job, say: Say) -> None:
    """Write the page."""
    from pathlib import Path

    from stiffdice.report.explorer import page

    (target,) = map(Path, job.output)
    page.write(target.parent, target)
    say(f"{target.stat().st_size:,} bytes")


if __name__ == "__main__":
    begin(__file__, globals()["snakemake"])
