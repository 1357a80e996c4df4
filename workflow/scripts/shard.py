"""Compute one shard and store its runs."""

from pathlib import Path

from job import Job, Say, Stopwatch, begin, tenths


def make(job: Job, say: Say) -> None:
    """Simulate the cells of the shard that its file's name is the digest of."""
    from inputs import opened

    from stiffdice.study import job_log
    from stiffdice.sweep import partition
    from stiffdice.sweep.reuse import Kept
    from stiffdice.sweep.shard import compute_shard

    planned, target = job.plan(), Path(job.output[0])
    plan = partition.of(planned)
    number, part, _, pieces = plan[target.stem]
    if number:
        survey = opened([("survey", job.input["survey"][0])], say)["survey"]
        pieces = partition.later(planned, survey, number)[part]
    kept = Kept(planned, pieces, target.parent, plan, say)
    watch = Stopwatch()
    with watch.running():
        cells = compute_shard(planned, pieces, target, tenths(say), kept)
    say(job_log.cells(cells, cells * planned.members))
    if kept:
        say(f"of these, {len(kept)} cells kept from shards of an earlier plan")
    say(f"simulation: {watch.seconds:.3f} s")


if __name__ == "__main__":
    begin(__file__, globals()["snakemake"])
