"""What is said of how long a run takes, going by the logs and benchmarks that its jobs leave."""

from __future__ import annotations

import os
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from tests import forks
from tests.workflow.test_workflow import ROOT

from stiffdice.study import config as studies
from stiffdice.study import job_log, outputs

HOUR = timedelta(hours=1)


@pytest.fixture
def duration(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "workflow")
    import duration

    monkeypatch.setattr(duration.forecast, "slowness", lambda: 1.0)
    monkeypatch.setattr(duration.forecast, "crowding", lambda cores: 1.0)
    return duration


@pytest.fixture
def study(monkeypatch, tmp_path, request):
    """The study that the test names, or `quick`, in a folder in which none of its results is."""
    monkeypatch.chdir(ROOT)
    found = studies.load(f"config/{getattr(request, 'param', 'quick')}.yaml")
    monkeypatch.chdir(tmp_path)
    return found


def of(study, stage):
    return [result for result in outputs.of(study) if result.stage == stage]


def file(study, name):
    path = Path("results", study.name, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def due(study, *some):
    return {file(study, result.benchmark).as_posix() for result in some or outputs.of(study)}


def run(study, result, begun, *lines, seconds=0.0):
    """Write the log of a job that began then and last said something so many seconds later."""
    path = file(study, result.log)
    first = re.sub(r"begun \S+", f"begun {begun:%Y-%m-%dT%H:%M:%SZ}", job_log.begun())
    path.write_text("".join(f"{line}\n" for line in (first, *lines)))
    os.utime(path, (0, begun.replace(microsecond=0).timestamp() + seconds))


def seconds_left(told):
    return told.left()[1]


def test_at_the_start_it_says_how_many_jobs_and_about_how_long(duration, study):
    told = duration.Duration({"quick": study}, due(study), 2).told()
    assert re.fullmatch(r"quick: 13 jobs, about \d+ s on 2 cores", told)


def test_only_what_is_to_be_made_counts(duration, study):
    first, second, _ = of(study, "figure")
    both, one = (duration.Duration({"quick": study}, due(study, *some), 1) for some in ((first, second), (first,)))
    assert one.told() == "quick: 1 job, about 1 s on 1 core"
    assert seconds_left(both) == pytest.approx(2 * seconds_left(one))


def test_other_work_on_the_machine_is_told_besides(duration, study, monkeypatch):
    monkeypatch.setattr(duration.forecast, "crowding", lambda cores: 60.0)
    told = duration.Duration({"quick": study}, due(study, of(study, "table" if study.tables else "figure")[0]), 1)
    assert told.told() == "quick: 1 job, about 1 s on 1 core; beside what else runs here now, 37 s"


@pytest.mark.parametrize("study", ["extremes"], indirect=True)
def test_an_experiment_takes_as_long_as_it_took(duration, study):
    experiment = of(study, "experiment")[0]
    file(study, experiment.benchmark).write_text("s\th:m:s\n600.5\t0:10:00\n")
    assert duration.Duration({"extremes": study}, due(study, experiment), 1).told().endswith("about 10 min on 1 core")


def test_what_is_left_goes_by_what_jobs_took_so_far(duration, study):
    figures = of(study, "figure")[:2]
    table = of(study, "frontier")[0]
    told = duration.Duration({"quick": study}, due(study, *figures, table), 1)
    before = seconds_left(told)
    run(study, figures[0], datetime.now(UTC), "done in 100 s", seconds=100)
    line, after = told.left()
    assert line.startswith("quick: 1 of 3 jobs done, about ")
    assert after == pytest.approx(100 * 0.94 / 0.62, rel=0.2)  # a figure and a frontier of the same slow machine
    assert after > 50 * before / 2


def test_a_job_that_is_under_way_is_half_done_when_it_says_so(duration, study):
    shard = of(study, "shard")[0]
    told = duration.Duration({"quick": study}, due(study, shard), 1)
    run(study, shard, datetime.now(UTC), "50% done", seconds=50)
    assert seconds_left(told) == pytest.approx(100, rel=0.05)


def test_what_an_earlier_run_left_says_nothing(duration, study):
    shard = of(study, "shard")[0]
    told = duration.Duration({"quick": study}, due(study, shard), 1)
    before = seconds_left(told)
    run(study, shard, datetime.now(UTC) - HOUR, "done in 100 s", seconds=100)
    assert told.left() == (f"quick: 0 of 1 jobs done, about {before:.0f} s left", before)


def test_what_failed_is_not_waited_for(duration, study):
    shard = of(study, "shard")[0]
    told = duration.Duration({"quick": study}, due(study, shard), 1)
    run(study, shard, datetime.now(UTC), "failed: no room", seconds=1)
    assert told.left() == ("quick: 0 of 1 jobs done, about 0 s left", 0)


def test_a_job_that_takes_longer_than_foreseen_is_told_as_such(duration, study):
    figure = of(study, "figure")[0]
    told = duration.Duration({"quick": study}, due(study, figure), 1)
    told._begun -= 60
    run(study, figure, datetime.now(UTC) - timedelta(seconds=50))
    assert told.left()[0] == "quick: 0 of 1 jobs done, what is left takes longer than foreseen"


# In a process of its own: who tells goes on as long as that lives.
TELLING = """
import os, sys, time
sys.path.insert(0, "workflow")
import duration
from stiffdice.study import config, outputs
duration.OFTEN = duration.SELDOM = 0.05
duration.forecast.crowding = lambda cores: 1.0
study = config.load("config/quick.yaml")
os.chdir(sys.argv[1])
duration.Duration({"quick": study}, {f"results/quick/{result.benchmark}" for result in outputs.of(study)}, 2).tell()
time.sleep(0.5)
"""


def test_while_it_runs_it_says_so_now_and_then(tmp_path):
    done = forks.run_code(TELLING, str(tmp_path), cwd=ROOT)
    first, *rest = done.stderr.splitlines()
    assert re.fullmatch(r"stiffdice: quick: 13 jobs, about \d+ s on 2 cores", first)
    assert 2 <= len(rest) <= 12
    assert all(re.fullmatch(r"stiffdice: quick: 0 of 13 jobs done, about \d+ s left", line) for line in rest)
