"""Draw one figure."""

from pathlib import Path

from job import Job, Say, begin


def make(job: Job, say: Say) -> None:
    """Draw the figure from its files."""
    from inputs import opened

    from stiffdice.report.figures import registry as figures
    from stiffdice.study.job_log import digest_of

    planned, data = job.plan(), opened(job.input.items(), say)
    made_from = {"study": job.wildcards["study"], "figure": job.wildcards["figure"]}
    made_from |= {f"file {name}": digest_of(Path(path)) for name, path in job.input.items()}
    figures.draw(planned.draw, data, planned.title, job.dpi, job.output, made_from)
    say(f"{planned.draw} drawn")


if __name__ == "__main__":
    begin(__file__, globals()["snakemake"])
