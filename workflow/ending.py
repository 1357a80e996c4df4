"""What a run that did not end well leaves to say: what failed, why, and what was not made because of it."""

from __future__ import annotations

import os
from pathlib import Path

from stiffdice import status, status_text, study
from stiffdice.errors import StiffdiceError

SCHEMA = "workflow/schemas/study.schema.yaml"


def told(root: Path, begun: float) -> str:
    """Return what failed in the studies of which a job has said something since `begun` [s since the epoch].

    root: the project. Where no job says that it failed, Snakemake's own log is all there is to name, if it began one.
    """
    os.chdir(root)  # scenes are named from here
    lines = []
    for name in _at_work(begun):
        try:
            failed = status_text.failures(status.of(study.load(f"config/{name}.yaml", SCHEMA), Path("results", name)))
        except StiffdiceError as error:
            failed = f"  {error}"
        if failed:
            lines += ["", f"what failed in {name}", failed]
    if lines:
        lines += ["", "what does not stand on that is done; the same command goes on from here"]
    return "\n".join([*lines, *_log_of_snakemake(begun)])


def _at_work(begun: float) -> list[str]:
    """Return the studies with a log that was written to since."""
    logs = (path for path in Path("results").glob("*/logs/**/*.log") if path.stat().st_mtime >= begun)
    return sorted({path.parts[1] for path in logs})


def _log_of_snakemake(begun: float) -> list[str]:
    """Return where Snakemake's own log of this run is, if it has begun one."""
    logs = [path for path in Path(".snakemake/log").glob("*.snakemake.log") if path.stat().st_mtime >= begun]
    return [f"Snakemake's own log: {max(logs, key=lambda path: path.stat().st_mtime)}"] if logs else []
