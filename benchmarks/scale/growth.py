"""One size: a dry run of it, then the study itself, once, from nothing."""

from __future__ import annotations

from statistics import median
from typing import Any

from benchmarks.scale.measures import Grown, Job, jobs_of, measured, wall_of
from benchmarks.scale.project import Project, Taken
from benchmarks.scale.record import Record

# Dry runs whose median is told; and the peak of the largest.
_DRY_RUNS = 3


def grow(project: Project, record: Record, data: dict[str, Any], name: str, cores: int) -> Grown:
    """Return what a study says of itself once it is made; one that was interrupted goes on, one that is there stays."""
    if name not in record:
        study = project.plan(name, data)
        if f"{name} dry" not in record:
            project.clear(name)
            planned = [project.dry_run(name)[1] for _ in range(_DRY_RUNS)]
            wall, cpu = median(dry.wall for dry in planned), median(dry.cpu for dry in planned)
            record[f"{name} dry"] = Taken(wall, cpu, max(dry.peak for dry in planned))
        with record.session(name):
            project.run(name, cores)
        top, sessions = project.results(name), record.sessions(name)
        wall, dry = wall_of(sessions, top), Taken(*record[f"{name} dry"])
        found = measured(study, top, cores, wall, len(sessions), dry, project.verify(name))
        record[name] = found._asdict()
    stored = record[name]
    return Grown(**stored | {part: Taken(*stored[part]) for part in ("dag", "verify")})


def made_anew(project: Project, record: Record, name: str, cores: int) -> tuple[float, list[Job]]:
    """Make what is due of a study that is planned; return the wall time [s], and the jobs that ran."""
    with record.session(name):
        project.run(name, cores)
    last = record.sessions(name)[-1]
    jobs = jobs_of(project.study(name), project.results(name), last.begun)
    assert last.seconds is not None, "a session that ended"
    return last.seconds, jobs
