"""A grid that is extended after it was computed, against the same made in one go: what is kept."""

from __future__ import annotations

from typing import Any, NamedTuple

from benchmarks.scale.growth import made_anew
from benchmarks.scale.project import Project
from benchmarks.scale.record import Record
from benchmarks.scale.studies import extended, runs_of
from stiffdice.io.reader import open_file

_NAME, _AT_ONCE = "extended", "at-once"


class Step(NamedTuple):
    """runs: of the study. wall, simulation [s]: of what was due: shards, and of the runs in them those not kept."""

    runs: int
    wall: float
    simulation: float
    shards: int
    simulated: int


class Extension(NamedTuple):
    """The grid; then the extended one, in the same folder; and in an empty one.

    same: whether the runs of the last two have the same digests.
    """

    grid: Step
    extended: Step
    at_once: Step
    same: bool


def extend(project: Project, record: Record, data: dict[str, Any], cores: int) -> Extension:
    """Return what a grid costs, what its extension does, and what both do in one go; begun anew if interrupted."""
    wider = extended(data)
    noted = f"{_NAME}-{runs_of(project.plan(_NAME, wider))}"
    if noted not in record:
        for name in (_NAME, _AT_ONCE):
            project.clear(name)
        grid = _made(project, record, data, _NAME, cores)
        later = _made(project, record, wider, _NAME, cores)
        whole = _made(project, record, wider, _AT_ONCE, cores)
        same = _digests(project, _NAME) == _digests(project, _AT_ONCE)
        record[noted] = [grid, later, whole, same]
    grid, later, whole, same = record[noted]
    return Extension(Step(*grid), Step(*later), Step(*whole), same)


def _made(project: Project, record: Record, data: dict[str, Any], name: str, cores: int) -> Step:
    study = project.plan(name, data)
    wall, jobs = made_anew(project, record, name, cores)
    simulated = sum((job.cells - job.kept) * study.sweeps[job.name.split("/")[0]].members for job in jobs if job.cells)
    shards = sum(job.stage == "shard" for job in jobs)
    return Step(runs_of(study), wall, sum(job.simulation for job in jobs), shards, simulated)


def _digests(project: Project, name: str) -> dict[str, str]:
    """Return the digest of all runs of each sweep."""
    top = project.results(name) / "sweeps"
    return {sweep: open_file(top / sweep / "sweep.h5").attrs["runs_digest"] for sweep in project.study(name).sweeps}
