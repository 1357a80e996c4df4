"""Tell what sweeps or experiments found as a table, for people and for programs."""

from job import Job, Say, begin


def make(job: Job, say: Say) -> None:
    """Write the table from its files, as Markdown and as CSV."""
    from inputs import opened

    from stiffdice.io.writer import write_bytes
    from stiffdice.study.catalogue import TABLES

    planned = job.plan()
    table = TABLES[planned.draw].load()(opened(job.input.items(), say), planned.title)
    markdown, csv = job.output
    write_bytes(table.markdown.encode(), markdown)
    write_bytes(table.csv.encode(), csv)
    say(f"{planned.draw} told")


if __name__ == "__main__":
    begin(__file__, globals()["snakemake"])
