"""Two workers against one: the same study on one core and on two, in turn."""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
from typing import Any, NamedTuple

from benchmarks.scale.growth import made_anew
from benchmarks.scale.project import Project
from benchmarks.scale.record import Record
from benchmarks.scale.studies import runs_of

_NAME = "workers"


class Workers(NamedTuple):
    """Wall times, and seconds in the simulator of all jobs, (round,) each."""

    runs: int
    one: list[float]
    two: list[float]
    one_simulation: list[float]
    two_simulation: list[float]

    @property
    def gain(self) -> float:
        """How many times as fast two are, by medians."""
        return median(self.one) / median(self.two)

    @property
    def slower(self) -> float:
        """How many times as long the same simulation takes, by medians, if another runs beside it."""
        return median(self.two_simulation) / median(self.one_simulation)


def compare(
    project: Project, record: Record, data: dict[str, Any], rounds: int, tell: Callable[[str], None]
) -> Workers:
    """Return the times of so many rounds; a round that was interrupted begins anew, one that is there stays."""
    runs = runs_of(project.plan(_NAME, data))
    name = f"{_NAME}-{runs}"
    done: list[list[float]] = record.get(name, [])
    for number in range(len(done), rounds):
        times = {}
        # The first of a round is the second of the next, so that a machine that grows slower is unfair to none.
        for cores in (1, 2) if number % 2 == 0 else (2, 1):
            tell(f"round {number + 1} of {rounds}, {cores} at work")
            project.clear(_NAME)
            wall, jobs = made_anew(project, record, _NAME, cores)
            times[cores] = wall, sum(job.simulation for job in jobs)
        done.append([times[1][0], times[2][0], times[1][1], times[2][1]])
        record[name] = done
    return Workers(runs, *(list(column) for column in zip(*done[:rounds], strict=True)))
