from __future__ import annotations

import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from stiffdice.simulation import batch_loop
from stiffdice.study import catalogue, forecast, job_log, outputs
from stiffdice.study import config as studies
from stiffdice.study.forecast import Job
from stiffdice.sweep import partition


@pytest.fixture
def load(monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[2])
    return lambda name: studies.load(f"config/{name}.yaml")


@pytest.fixture
def compiled(monkeypatch, tmp_path):
    """A folder with the loop of a run, compiled, under the name that Numba gives it."""
    loop = batch_loop._march
    module = loop.py_func.__module__.rpartition(".")[2]
    monkeypatch.setattr(forecast, "cache_folder", lambda: tmp_path)
    (tmp_path / f"{module}.{loop.py_func.__qualname__}-1.py311.0123456789abcdef.nbc").touch()


@pytest.mark.usefixtures("compiled")
def test_every_job_takes_its_start_and_a_shard_its_predicted_work_besides(load):
    study = load("quick")
    (sweep,) = study.sweeps.values()
    found = forecast.seconds(study)
    assert list(found) == outputs.of(study)
    assert all(0.3 < seconds < 20 for seconds in found.values())
    for name, shard in partition.of(sweep).items():
        (seconds,) = (taken for result, taken in found.items() if result.name == f"steps-needed/{name}")
        assert seconds - shard.seconds * (0.25 if shard.round else 1) == pytest.approx(0.42)


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize(
    ("name", "core_seconds"),  # of the processor, as `time` told them of whole runs
    [("paper", 26), ("refinement", 219), ("stability", 431), ("extremes", 103), ("tradeoff", 228)],
)
def test_what_was_measured_is_foretold_within_a_factor_of_one_and_a_half(load, name, core_seconds):
    assert 1 / 1.5 < sum(forecast.seconds(load(name)).values()) / core_seconds < 1.5


def test_where_nothing_is_compiled_it_takes_longer(load, compiled, monkeypatch, tmp_path):
    study = load("paper")
    warm = forecast.seconds(study)
    monkeypatch.setattr(forecast, "cache_folder", lambda: tmp_path / "nowhere")
    more = {result: seconds - warm[result] for result, seconds in forecast.seconds(study).items()}
    assert {result.stage for result, seconds in more.items() if seconds} == {"trajectory", "shard"}
    assert sum(more.values()) == pytest.approx(2 * 6 + 12)  # two models of runs, one of the sweep


def test_no_measure_is_forgotten():
    assert set(catalogue.EXPERIMENTS) <= set(forecast._EXPERIMENT)
    assert set(catalogue.TIMINGS) <= set(forecast._TIMING)


@pytest.mark.usefixtures("compiled")
def test_experiments_with_more_throws_take_longer(load):
    study = load("landing")
    found = {result.name: seconds for result, seconds in forecast.seconds(study).items()}
    throws = {name: each.options["throws"] for name, each in study.experiments.items() if each.measure == "landing"}
    start = 0.42
    assert {name: (found[name] - start) / throws[name] for name in throws} == pytest.approx(dict.fromkeys(throws, 1e-4))
    kinds = {forecast.kind_of(study, result) for result in outputs.of(study)}
    assert kinds == {"experiment landing", "experiment coarse-steps", "figure"}


@pytest.mark.parametrize("throws", ["many", -1, 0, None, 2.5])
def test_a_number_of_throws_that_is_none_is_for_the_experiment_to_refuse(load, throws):
    study = load("landing")
    study.experiments["fair"].options["throws"] = throws
    assert all(seconds > 0 for seconds in forecast.seconds(study).values())


def test_a_hundredth_of_a_second_tells_how_fast_this_machine_is():
    forecast.slowness()
    begun = time.process_time()
    first, second = forecast.slowness(), forecast.slowness()
    assert time.process_time() - begun < 0.05
    assert 1 / 1.3 < first / second < 1.3
    assert 0.1 < first < 30


def test_jobs_beside_others_take_longer():
    assert forecast.crowding(2) >= 1
    assert forecast.crowding(10_000) < 1.1


def done(kind, weight, took):
    return Job(kind, weight, took, due=False)


def due(kind, weight=1.0, took=None, log=None):
    return Job(kind, weight, took, due=True, log=log)


@pytest.mark.parametrize(
    ("jobs", "cores", "left"),
    [
        ([], 1, 0),
        ([done("shard", 2, 10)], 1, 0),
        ([due("shard")], 1, 2),  # nothing has ended: as foretold
        ([due("shard", took=7)], 1, 7),  # as long as it took before
        ([done("shard", 2, 10), due("shard", 3)], 1, 15),  # as its kind, by weight
        ([done("shard", 1, 1), done("shard", 1, 3), done("shard", 1, 50), due("shard")], 1, 3),  # the median
        ([done("figure", 2, 10), due("shard", 3)], 1, 15),  # as all others, where none of its kind has ended
        ([done("figure", 2, 10), done("shard", 1, 1), due("shard", 3)], 1, 3),
        ([done("a measure", 2, 10), done("another", 1, 1), due("another", 3)], 1, 3),  # each as its own
        ([due("shard", took=10) for _ in range(4)], 2, 20),
        ([due("shard", took=30), due("shard", took=2)], 8, 30),  # the longest, if there are cores enough
        ([due("shard", took=10), due("timings", took=5), due("timings", took=5)], 2, 20),
    ],
)
def test_time_left(jobs, cores, left):
    assert forecast.left(jobs, cores, pace=2.0) == left


@pytest.mark.parametrize(
    ("progress", "took", "left"), [(0.8, 10, 0), (0.4, 10, 16.3), (0.1, 10, 53.1), (0.0, 100, 70), (0.0, 10, 0)]
)
def test_a_running_job_takes_as_long_as_its_progress_says(tmp_path, progress, took, left):
    """Else as it took before; it has run for 30 s, and said after 20 s how far it was."""
    (tmp_path / "log").write_text(f"{job_log.begun()}\n")
    log, now = job_log.read(tmp_path / "log"), datetime.now(UTC)
    log = log._replace(begun=now - timedelta(seconds=30), written=now - timedelta(seconds=10), progress=progress)
    assert forecast.left([due("shard", took=took, log=log)], 1, pace=2.0) == pytest.approx(left, abs=0.5)
