# What the rules share: studies, read and checked once, and the paths that follow from them.

import hashlib
import sys
from functools import cache
from pathlib import Path

from stiffdice import study as studies
from stiffdice.errors import InputError
from stiffdice.provenance import code_digest

SCHEMA = Path(workflow.basedir) / "workflow" / "schemas" / "study.schema.yaml"


wildcard_constraints:
    study=studies.NAME.pattern,
    run="[a-z0-9][a-z0-9-]*",
    figure="[a-z0-9][a-z0-9-]*",
    preset="as_listed|as_written|corrected",
    shard="[0-9a-f]{12}",


def code_of(script, *modules):
    """Return a digest of a script and of the library modules it stands on.

    Snakemake's own code trigger goes by the time a script was changed, which a checkout changes, too; and it does not
    see the library. The profile turns it off.
    """
    digest = hashlib.sha256(code_digest(*modules).encode())
    for name in (script, "job.py"):
        digest.update((Path(workflow.basedir) / "workflow" / "scripts" / name).read_bytes())
    return digest.hexdigest()


@cache
def study(name):
    """Return the study in config/NAME.yaml; a mistake in it ends Snakemake with one line and exit status 2."""
    try:
        return studies.load(f"config/{name}.yaml", SCHEMA)
    except InputError as error:
        print(f"stiffdice: {error}", file=sys.stderr)
        sys.exit(2)


@cache
def shards_of(name):
    return study(name).sweep.shards() if study(name).sweep else {}


def planned_run(wildcards):
    return study(wildcards.study).runs[wildcards.run]


def planned_figure(wildcards):
    return study(wildcards.study).figures[wildcards.figure]


def figure_files(name, figure):
    """Return the files of one figure: an animation is a GIF, the others are SVG and PNG."""
    kinds = ["gif"] if study(name).figures[figure].draw == "animation" else ["svg", "png"]
    return [f"results/{name}/figures/{figure}.{kind}" for kind in kinds]


def data_of(wildcards):
    """Return the files a figure is drawn from: a run as listed and as written, or the frontier of a sweep."""
    planned = planned_figure(wildcards)
    folder = f"results/{wildcards.study}"
    if planned.run is None:
        return {"frontier": f"{folder}/sweep/frontier.h5"}
    presets = study(wildcards.study).runs[planned.run].presets
    return {preset: f"{folder}/runs/{planned.run}.{preset}.h5" for preset in presets}


def everything_of(name):
    """Return all results of a study."""
    planned = study(name)
    files = [file for figure in planned.figures for file in figure_files(name, figure)]
    files += [f"results/{name}/runs/{run}.{preset}.h5" for run in planned.runs for preset in planned.runs[run].presets]
    if planned.sweep:
        files += expand("results/{study}/sweep/{file}", study=name, file=["sweep.h5", "frontier.h5", "frontier.csv"])
    return files


# A mistake in the study asked for is told before anything else is said.
study(str(config.get("study", "paper")))
