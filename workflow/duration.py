"""How long a run of the workflow takes: about, at its start; and now and then what is left, until it ends."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Collection, Mapping
from pathlib import Path

from following import EVERY

from stiffdice.study import forecast, job_log
from stiffdice.study.config import Study
from stiffdice.study.forecast import Job
from stiffdice.study.outputs import Result
from stiffdice.study.status import duration

MEASURING = ("experiment", "timings")  # of which nothing tells better how long they take than how long they took
OFTEN, SELDOM, LINES = 20.0, 300.0, 8  # s between two lines, at least and at most; about so many lines
CROWDED = 1.2  # times as long as alone that is worth a word


class Duration:
    """About how long some jobs take, of studies by name; due: their benchmark files, under the project's folder."""

    def __init__(self, studies: Mapping[str, Study], due: Collection[str], cores: int) -> None:
        self._cores, self._begun = cores, time.time()
        self._crowding = forecast.crowding(cores)
        slowness = forecast.slowness()
        self._expected: dict[tuple[Path, Result], tuple[str, float]] = {}
        for name, study in studies.items():
            folder = Path("results", name)
            for result, seconds in forecast.seconds(study).items():
                if (folder / result.benchmark).as_posix() in due:
                    before = job_log.took(folder / result.benchmark) if result.stage in MEASURING else None
                    expected = forecast.kind_of(study, result), before or seconds * slowness
                    self._expected[folder, result] = expected
        self._name = ", ".join(studies)

    def told(self) -> str:
        """Return a line on the whole of it, as it looks before it begins."""
        alone, here = (forecast.left(self._jobs(), self._cores, pace) for pace in (1.0, self._crowding))
        crowd = f"; beside what else runs here now, {duration(here)}" if self._crowding > CROWDED else ""
        jobs, cores = len(self._expected), f"{self._cores} core{'s' if self._cores > 1 else ''}"
        return f"{self._name}: {jobs} job{'s' if jobs > 1 else ''}, about {duration(alone)} on {cores}{crowd}"

    def left(self) -> tuple[str, float]:
        """Return a line on what is left, and how long that is [s].

        It goes by how long the jobs that have ended took, next to what was expected of them.
        """
        jobs = self._jobs()
        seconds = forecast.left(jobs, self._cores, self._crowding)
        late = not seconds and any(job.due for job in jobs)
        rest = "what is left takes longer than foreseen" if late else f"about {duration(seconds)} left"
        done = sum(job.took is not None and not job.due for job in jobs)
        return f"{self._name}: {done} of {len(jobs)} jobs done, {rest}", seconds

    def tell(self) -> None:
        """Say at once how long it takes, and from now on what is left, as long as this process lives."""
        _say(self.told())
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        _, seconds = self.left()
        every = float(os.environ.get(EVERY, "0"))
        while True:
            time.sleep(every or min(max(OFTEN, seconds / LINES), SELDOM))
            line, seconds = self.left()
            _say(line)

    def _jobs(self) -> list[Job]:
        return [self._job(*place, *expected) for place, expected in self._expected.items()]

    def _job(self, folder: Path, result: Result, kind: str, weight: float) -> Job:
        """Return what is known of a job so far: nothing of an earlier run's."""
        told = job_log.read(folder / result.log)
        if told is None or told.begun is None or told.begun.timestamp() < self._begun - 1:  # told in whole seconds
            told = None
        if told is None or not told.ending:
            return Job(kind, weight, None, True, told)
        took = (told.written - told.begun).total_seconds() if told.ending == "done" else None
        return Job(kind, weight, took, False)


def _say(line: str) -> None:
    """Write a line in one piece, as Snakemake writes from other threads."""
    sys.stderr.write(f"stiffdice: {line}\n")
    sys.stderr.flush()
