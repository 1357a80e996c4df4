"""What a run leaves to say at its end: what to open first, or what failed, why, and what was not made because of it."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

from stiffdice.errors import StiffdiceError, printable
from stiffdice.io import yaml_loader
from stiffdice.study import job_log
from stiffdice.study.catalogue import DRAWINGS

FAILED = "what failed in"


def told(root: Path, begun: float, studies: Collection[str]) -> str:
    """Return what failed in those of some studies of which a job has said something since `begun` [s since the epoch].

    root: the project. Where no job says that it failed, Snakemake's own log is all there is to name, if it began one.
    """
    from stiffdice.study import config as study
    from stiffdice.study import status  # half a second

    os.chdir(root)  # scenes are named from here
    lines = []
    for name in sorted(name for name in studies if _at_work(name, begun)):
        try:
            failed = status.failures(status.of(study.load(f"config/{name}.yaml"), Path("results", name)))
        except StiffdiceError as error:
            failed = f"  {error}"
        if failed:
            lines += ["", f"{FAILED} {name}", failed]
    if lines:
        lines += ["", "what does not stand on that is done; the same command goes on from here"]
    return "\n".join([*lines, *_log_of_snakemake(begun, studies)])


def open_first(root: Path, study: str) -> str:
    """Return which of a study's figures answers its question, and where it lies; empty if none is there.

    The first that shows more than single runs; else the first figure, or table. One in SVG opens in any browser.
    """
    plan = yaml_loader.load(root / "config" / f"{study}.yaml")
    figures, tables = plan.get("figures", {}), plan.get("tables", {})
    answers = {name: figure for name, figure in figures.items() if DRAWINGS[figure["draw"]].given != "runs"}
    for kind, shown in (("figures", answers | figures), ("tables", tables)):
        for name, part in shown.items():
            for suffix in (".svg", ".gif", ".md"):
                path = Path("results", study, kind, f"{name}{suffix}")
                if (root / path).is_file():
                    return printable(f"open first: {path} ({part['title']})")
    return ""


def _at_work(study: str, begun: float) -> bool:
    """Return whether a log of a study was written to since."""
    return any(path.stat().st_mtime >= begun for path in Path("results", study).glob("logs/**/*.log"))


def _log_of_snakemake(begun: float, studies: Collection[str]) -> list[str]:
    """Return where Snakemake's own log of this run is, if it has begun one: the last that names a file of a study."""
    found = [path for path in Path(".snakemake/log").glob("*.snakemake.log") if path.stat().st_mtime >= begun]
    for path in sorted(found, key=lambda path: path.stat().st_mtime, reverse=True):
        text = job_log.text_of(path)
        if any(f"results/{study}/" in text for study in studies):
            return [f"Snakemake's own log: {path}"]
    return []
