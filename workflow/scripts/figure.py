"""Draw one figure."""

from job import Job, Say, begin


def make(job: Job, say: Say) -> None:
    """Draw the figure from its files."""
    from inputs import opened

    from stiffdice.report.figures import registry as figures

    planned, data = job.plan(), opened(job.input.items(), say)
    figures.draw(planned.draw, data, planned.title, job.dpi, job.output)
    say(f"{planned.draw} drawn")


if __name__ == "__main__":
    begin(__file__, globals()["snakemake"])
