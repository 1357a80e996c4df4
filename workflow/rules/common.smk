# What the rules share: studies, read and checked once, and the paths that follow from them.

import math
import os
import sys
import time
from functools import cache
from pathlib import Path

from stiffdice.cli.terminal.progress import notes
from stiffdice.errors import InputError, printable
from stiffdice.study import config as studies
from stiffdice.study import job_log
from stiffdice.study import outputs as results
from stiffdice.study.catalogue import DRAWINGS, TABLES
from stiffdice.sweep import partition as shards

SCHEMA = Path(workflow.basedir) / "workflow" / "schemas" / "study.schema.yaml"
BEGUN = time.time()

# What this process needs besides the rules.
sys.path += [str(Path(workflow.basedir) / "workflow"), str(Path(workflow.basedir) / "workflow" / "scripts")]

from job import Sealed


wildcard_constraints:
    study=studies.NAME.pattern,
    run="[a-z0-9][a-z0-9-]*",
    figure="[a-z0-9][a-z0-9-]*",
    preset="as_listed|as_written|corrected",
    shard="[0-9a-f]{12}",
    sweep="[a-z0-9][a-z0-9-]*",
    round="[0-9]+",
    experiment="[a-z0-9][a-z0-9-]*",
    timing="[a-z0-9][a-z0-9-]*",
    table="[a-z0-9][a-z0-9-]*",


@cache
def study(name):
    """Return the study in config/NAME.yaml; a mistake in it ends Snakemake with one line and exit status 2."""
    try:
        with notes(f"stiffdice: reading config/{name}.yaml"):
            return studies.load(f"config/{name}.yaml", SCHEMA)
    except InputError as error:
        print(f"stiffdice: {error}", file=sys.stderr)
        sys.exit(2)


@cache
def needs_of(name):
    """Return what each result of a study is made from; a link to nothing in the place of one ends Snakemake (2)."""
    with notes(f"stiffdice: planning the sweeps of {name}"):
        found = results.needs(study(name))
    for line in filter(None, (results.dangling(result, Path("results", name)) for result in found)):
        print(f"stiffdice: {printable(line)}", file=sys.stderr)
        sys.exit(2)
    return {(result.stage, result.name): (result, parts) for result, parts in found.items()}


@cache
def asked_by(name):
    needs_of(name)
    return results.asked(study(name))


@cache
def parameters_by(name):
    return {(result.stage, result.name): str(digests) for result, digests in asked_by(name).items()}


def asked_of(stage, name):
    """Return a parameter: digests of all that a result follows from; name: its own in the stage, with wildcards.

    It takes the place of Snakemake's own code trigger, which goes by the time a script was changed, as a checkout
    changes it, and does not see the library. The profile turns that off.
    """
    return lambda wildcards: parameters_by(wildcards.study)[stage, name.format(**dict(wildcards.items()))]


@cache
def stale_files(name):
    top = Path("results", name)
    return [f"{top}/{file}" for result in results.stale(asked_by(name), top) for file in result.files]


def not_stale(wildcards):
    """Return no file, as input of every rule; results that something else was asked of are made again.

    Snakemake sees by itself what has changed since it last made a result, but not if its notes are lost.
    """
    if workflow.is_main_process:
        workflow.dag.forcefiles.update(stale_files(wildcards.study))
    return []


def planned(kind):
    """Return a parameter: what a study plans for a job, a `run`, `sweep`, `experiment`, `timing`, `figure` or `table`."""
    return lambda wildcards: getattr(study(wildcards.study), f"{kind}s")[wildcards[kind]]


def sealed(kind):
    """Return the same as a parameter that Snakemake does not compare; it compares `asked`, which says more."""
    return lambda wildcards: Sealed(planned(kind)(wildcards))


def shard_of(wildcards):
    return shards.of(planned("sweep")(wildcards))[wildcards.shard]


def minutes_of(shard):
    """Return how long a shard may take: machines are slower than the one that predictions are for, and compile first."""
    return 10 + 4 * math.ceil(shard.seconds / 60)


def made_from(kind, stage, name):
    """Return an input: files of one stage that a result is made from; name: its own in its stage, with wildcards."""

    def files(wildcards):
        _, parts = needs_of(wildcards.study)[stage, name.format(**dict(wildcards.items()))]
        return [f"results/{wildcards.study}/{part.files[0]}" for part in parts if part.stage == kind]

    return files


def survey_of_shard(wildcards):
    """Return the survey that says where the cells of a later round's shard lie, `ancient` unless the shard is stale.

    Of what depends by ancient files alone on a job that is due, Snakemake does not ask whether it is due itself.
    """
    files = made_from("survey", "shard", "{sweep}/{shard}")(wildcards)
    shard = f"results/{wildcards.study}/sweeps/{wildcards.sweep}/shards/{wildcards.shard}.h5"
    return files if workflow.is_main_process and shard in stale_files(wildcards.study) else ancient(files)


def shown_by(stage, entries):
    """Return an input: the files that a figure or a table shows, by their names; timings shown besides are apart."""

    def files(wildcards):
        draw = planned(stage)(wildcards).draw
        _, parts = needs_of(wildcards.study)["animation" if draw.endswith("animation") else stage, wildcards[stage]]
        found = {}
        for part in parts:
            name = part.name.partition(".")[2] if part.stage == "trajectory" else part.name
            timed = part.stage == "timings" and entries[draw].given != "timings"
            found[f"{name} timed" if timed else name] = f"results/{wildcards.study}/{part.files[0]}"
        return found

    return files


def growing(amount):
    """Return a resource that a job gets twice as much of with every further attempt."""
    return lambda wildcards, attempt: amount * 2 ** (attempt - 1)


def on_cluster():
    """Return whether jobs run on other machines, or this is one of them."""
    return workflow.remote_exec or workflow.non_local_exec


def ready_for_cluster():
    """Look whether Slurm, if that is asked, can be; what is missing ends Snakemake with one line and exit status 2."""
    if workflow.executor_plugin.name != "slurm":
        return
    import slurm
    from snakemake.logging import logger

    logger.addHandler(slurm.Failures())
    given = {key: resource.raw for key, resource in (workflow.resource_settings.default_resources or {}).items()}
    try:
        line = slurm.prepare(workflow.executor_settings.status_command, given)
    except slurm.SlurmError as error:
        print(f"stiffdice: {error}", file=sys.stderr)
        sys.exit(2)
    if line:
        print(f"stiffdice: {line}", file=sys.stderr)


def tell_of_cluster():
    """Say what failed on other machines, as workflow/run.py does for this one."""
    if on_cluster():
        import ending

        print(ending.told(Path(workflow.basedir), BEGUN, {*jobs_due().values()}), file=sys.stderr)


@cache
def jobs_due():
    """Return the studies of which something is to be made when first asked, by the benchmark files of their jobs."""
    return {str(job.benchmark): job.wildcards.study for job in workflow.dag.needrun_jobs() if job.benchmark}


def one_at_a_time():
    """Lock the studies of which something is to be made; is one being made, that ends Snakemake with exit status 2."""
    import lock

    try:
        for name in sorted({*jobs_due().values()}):
            lock.hold(Path(workflow.basedir), name)
    except lock.RunningError as error:
        print(f"stiffdice: {error}", file=sys.stderr)
        sys.exit(2)


def clear_way():
    """Remove what is in the way of logs and benchmarks; what stays ends Snakemake with one line and exit status 2."""
    import room

    jobs = list(workflow.dag.needrun_jobs())
    try:
        room.clear_way(Path(file) for job in jobs for file in (*job.log, *([job.benchmark] if job.benchmark else [])))
    except room.RoomError as error:
        print(f"stiffdice: {error}", file=sys.stderr)
        sys.exit(2)


def set_aside_changed():
    """Keep, as NAME.damaged, what took the place of what a job made, before Snakemake removes it to make that again."""
    for name in {*jobs_due().values()}:
        top = Path("results", name)
        for result in results.stale(asked_by(name), top):
            told = job_log.read(top / result.log)
            if told is None or f"{top}/{result.benchmark}" not in jobs_due():
                continue
            for file in job_log.changed(told, top, *(file for file in result.files if file in told.made)):
                (top / file).rename(top / f"{file}.damaged")
                print(
                    f"stiffdice: {top}/{file}: not what its job made: another file in its place, or changed by hand; "
                    f"set aside as {Path(file).name}.damaged, and made again",
                    file=sys.stderr,
                )


def tell_how_long():
    """Say about how long it takes, and then what is left; of a cluster, whose jobs queue, and of no job, nothing."""
    if on_cluster() or workflow.touch or not jobs_due():
        return
    import duration

    due = {name: study(name) for name in sorted({*jobs_due().values()})}
    duration.Duration(due, jobs_due().keys(), workflow.cores).tell()


@cache
def tell_left_out(name):
    for line in study(name).left_out:
        print(f"stiffdice: {line}", file=sys.stderr)


def everything_of(name):
    """Return all results of a study; what needs an engine that is not installed is left out, with a line."""
    tell_left_out(name)
    return [f"results/{name}/{file}" for result, _ in needs_of(name).values() for file in result.files]


def everything_finished():
    """Return all results of the studies of which none is missing or stale; those that have begun are named."""
    begun = [path.stem for path in sorted(Path("config").glob("*.yaml")) if Path("results", path.stem).is_dir()]
    whole = [name for name in begun if all(map(os.path.exists, everything_of(name))) and not stale_files(name)]
    for name in sorted({*begun} - {*whole}):
        print(f"stiffdice: left out: {name} is not finished: make status STUDY={name}", file=sys.stderr)
    if not whole:
        print("stiffdice: no study is finished; make paper makes the first", file=sys.stderr)
        sys.exit(2)
    return [file for name in whole for file in everything_of(name)]


# The order in which a reader meets the studies; the report sorts by name.
CHAPTERS = {
    **{"paper": "1 Paper", "tradeoff": "3 Trade", "pair": "5 Pair"},
    **dict.fromkeys(("stability", "extremes", "refinement", "million"), "2 Stability"),
    **dict.fromkeys(("landing", "shapes", "tosses"), "4 Dice"),
    **dict.fromkeys(("engines", "pair-engines", "granular"), "6 Engines"),
}


def chapter(wildcards):
    """Return the chapter of the report that a study belongs to."""
    return CHAPTERS.get(wildcards.study, "7 Other studies")


# A mistake in the study asked for is told before anything else is said.
study(str(config.get("study", "paper")))
