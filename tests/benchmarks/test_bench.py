"""What a bench promises: that all of it is told, and that noise is not called a change. No time is asserted."""

from __future__ import annotations

import csv
import io
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from benchmarks import BENCHMARKS, cold, engines, jobs, octave, report
from benchmarks.__main__ import main as benchmarks_main
from benchmarks.aims import RATIOS, TIMES, reached
from benchmarks.case import FULL, QUICK, Case, Missing
from benchmarks.compare import changes, differences
from benchmarks.roof import LATENCIES, vector_width
from benchmarks.rounds import due, measured
from benchmarks.rows import best_of, rows_of
from benchmarks.run import gathered
from benchmarks.scenes import scene_of
from benchmarks.store import PART, dataset_of, last_in, path_for

from stiffdice.cli.main import main
from stiffdice.errors import NotInstalledError, StiffdiceError
from stiffdice.io.reader import open_file
from stiffdice.simulation.engines.registry import ready

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where two quick benches lie, made as a user makes them."""
    folder = tmp_path_factory.mktemp("bench")
    for k in range(2):
        assert benchmarks_main(["listing", "skipping", "--quick", "--folder", str(folder)]) == 0
        if k == 0:  # names are by the second
            (made,) = folder.glob("*.h5")
            made.rename(folder / "2026-01-01T000000Z-quick.h5")
    return folder


@pytest.fixture(scope="module")
def last(folder):
    return last_in(folder, "-quick")


@pytest.fixture(scope="module")
def bench(last):
    return open_file(last)


@pytest.mark.broad
def test_every_row_has_unit_median_spread_and_what_holds_it_back(bench):
    rows = {row.name: row for row in rows_of(bench)}
    assert {"cycle", "fma_peak", *(f"latency_{name}" for name in LATENCIES)} <= set(rows)
    for model in ("tumbling", "vertical"):
        assert {
            f"listing_{model}_gated",
            f"listing_{model}_ungated",
            f"sweep_{model}",
            f"sweep_{model}_stepped",
        } <= set(rows)
    for row in rows.values():
        assert row.unit == "s"
        assert row.seconds > 0
        assert row.spread >= 0
        assert row.samples == QUICK.rounds
        assert row.cycles > 0
        assert "\n" not in row.limited_by
        assert len(row.limited_by) > 20
        if row.name.startswith("listing"):
            assert row.bound > 0
            assert row.share > 0


@pytest.mark.broad
def test_no_limit_is_beyond_any_processor(bench):
    """The calls do the work they are said to do: a busy machine makes them slower, but nothing makes them faster."""
    assert 1 / best_of(bench, "cycle") < 1e10
    assert 1 / best_of(bench, "fma_peak") < 1e10 * 2 * 2 * vector_width() / 64
    assert all(1 / best_of(bench, f"latency_{name}") < 1e10 for name in LATENCIES)


@pytest.mark.broad
def test_the_table_for_programs_has_the_same_rows(bench, last):
    rows = list(csv.DictReader(io.StringIO(last.with_suffix(".csv").read_text())))
    assert [row["case"] for row in rows] == [row.name for row in rows_of(bench)]
    for told, row in zip(rows, rows_of(bench), strict=True):
        assert float(told["median"]) == pytest.approx(row.seconds, rel=1e-5)
        assert told["limited_by"] == row.limited_by


@pytest.mark.broad
def test_the_file_says_what_it_was_measured_with(bench):
    assert bench.attrs["Conventions"].startswith("CF-")
    assert bench.attrs["vector_width"] == vector_width()
    assert bench.attrs["vector_width"] in (128, 256, 512)
    for key in ("machine_processor", "versions", "compiler", "compiler_target", "measured_at", "bench_code_digest"):
        assert bench.attrs[key], key
    for variable in bench.variables.values():
        assert variable.attrs["units"]
        assert variable.attrs["long_name"]


@pytest.mark.broad
def test_the_second_bench_is_compared_with_the_first(last):
    page = last.with_suffix(".md").read_text()
    assert "## Since 2026-01-01T000000Z-quick" in page
    assert all(aim.what in page for aim in (*RATIOS, *TIMES))
    assert "A quick one" in page


def test_an_unknown_name_is_refused_before_any_work(capsys):
    assert benchmarks_main(["lissting"]) == 2
    assert "NAME = lissting: allowed is roof or listing" in capsys.readouterr().err


@pytest.mark.long
def test_every_benchmark_says_what_it_measures_and_why_it_does_not(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # no Snakefile here
    cases, missing = gathered(list(BENCHMARKS), FULL)
    names = [case.name for case in cases]
    assert len(set(names)) == len(names)
    assert "shard_jobs" in [part.name for part in missing]
    for case in cases:
        assert case.name.isidentifier()
        assert case.amount > 0
        assert 0 < case.times <= FULL.rounds
        assert set(case.chain) <= set(LATENCIES)


def test_an_engine_that_is_not_installed_costs_a_line(monkeypatch):
    def missing(name):
        raise NotInstalledError("simulator = drake: needs the package drake, which is not installed")

    monkeypatch.setattr(engines, "adapter_of", missing)
    monkeypatch.setattr(engines, "ENGINES", {"drake": ("Drake", 10, "")})
    assert list(engines.cases(QUICK)) == [
        Missing("drake", "Drake: simulator = drake: needs the package drake, which is not installed")
    ]


# The logic, on times made up.


@pytest.mark.parametrize(("times", "rounds"), [(1, 1), (1, 5), (3, 7), (7, 7), (5, 21), (0, 4)])
def test_turns_are_as_many_as_asked_and_spread(times, rounds):
    turns = [number for number in range(rounds) if due(number, times, rounds)]
    assert len(turns) == times
    if times > 1:
        assert np.ptp(np.diff(turns)) <= 1


@pytest.mark.long
def test_cases_take_turns_and_what_stands_alone_is_not_warmed_up():
    calls = []

    def case(name, times, fresh):
        return Case(name, name, "call", 10, lambda: lambda: calls.append(name), times, "", fresh=fresh)

    samples = measured([case("warm", 4, False), case("fresh", 2, True)], 4)
    assert np.isfinite(samples[0]).all()
    np.testing.assert_array_equal(np.isfinite(samples[1]), [True, False, True, False])
    assert calls.count("fresh") == 2
    assert calls[0] == "warm"


def made(times, rounds=5, **attributes):
    """A bench with these median times, each spread by so much of it: name → (seconds, spread, flops, chain)."""
    cases, samples = [], []
    for name, (seconds, spread, flops, chain) in times.items():
        cases.append(Case(name, name, "step", 1.0, lambda: lambda: None, rounds, "what holds it", flops, chain))
        samples.append(seconds * (1 + spread * np.linspace(-2, 2, rounds)))
    machine = {"machine_processor": "a", "machine_cores": 2, "quick": 0, "jobs": 4, **attributes}
    return dataset_of(cases, [], np.array(samples), machine)


ROOF = {
    "cycle": (1e-9, 0.0, 0, ()),
    "latency_add": (2e-9, 0.0, 1, ()),
    "latency_divide": (1e-8, 0.0, 1, ()),
    "fma_peak": (1e-10, 0.0, 1, ()),
}


def test_a_kernel_is_told_by_what_waits_and_else_by_the_peak():
    rows = {
        row.name: row
        for row in rows_of(made(ROOF | {"a": (5e-8, 0.01, 20, ("add", "add", "divide")), "b": (4e-9, 0.02, 20, ())}))
    }
    assert rows["a"].cycles == pytest.approx(50)
    assert (rows["a"].bound, rows["a"].bound_by) == (pytest.approx(14), "waiting")
    assert rows["a"].share == pytest.approx(0.04)
    assert (rows["b"].bound, rows["b"].bound_by) == (pytest.approx(2), "peak")
    assert rows["b"].share == pytest.approx(0.5)
    assert rows["b"].spread == pytest.approx(0.02)
    assert np.isnan(rows["cycle"].bound)


def test_aims_are_ratios_of_a_round_and_say_whether_they_are_met():
    bench = made(
        ROOF
        | {
            "mujoco_rollout_tumbling_gated": (2.5e-6, 0.0, 0, ()),
            "mujoco_rollout_vertical_gated": (1e-6, 0.0, 0, ()),
            "ensemble_tumbling_gated": (9e-9, 0.0, 10, ()),
            "ensemble_vertical_gated": (1e-9, 0.0, 0, ()),
            "ensemble_sliding_ungated": (2e-9, 0.0, 10, ()),
            "help": (0.1, 0.0, 0, ()),
            "first_run_event": (20.0, 0.0, 0, ()),
            "later_run": (2.0, 0.0, 0, ()),
            "one_shard": (5.0, 0.0, 0, ()),
            "more_shards": (9.0, 0.0, 0, ()),
        }
    )
    found = {aim.what: aim for aim in reached(bench)}
    expected = {
        "throw, gated: MuJoCo's rollout over the loop of sweeps": (2500 / 9, True),
        "vertical, gated: MuJoCo's rollout over the loop of sweeps": (1000, False),
        "sliding, ungated: share of the FMA peak": (0.5, None),
        "stiffdice --help": (0.1, True),
        "compilation in a first run, event": (18, False),
        "a shard's job, beyond its simulation": (1, True),
    }
    for what, (value, met) in expected.items():
        assert found[what].value == pytest.approx(value), what
        assert found[what].met is met, what
    assert found["compilation in a first run, sliding"].met is None
    assert np.isnan(found["compilation in a first run, sliding"].value)
    page = report.page(bench.assign_attrs(FULL_TOLD), None, "now")
    assert "| compilation in a first run, sliding | at most 15 s | not measured | — |  |" in page


FULL_TOLD = dict.fromkeys(("machine_system", "versions", "compiler", "compiler_target"), "x") | {
    "vector_width": 512,
    "machine_load_1_minute": 0.1,
}


@pytest.mark.parametrize(
    ("before", "now", "spread", "verdict"),
    [
        (1.0, 1.03, 0.0, "the same"),
        (1.0, 1.3, 0.0, "slower"),
        (1.3, 1.0, 0.0, "faster"),
        (1.0, 1.3, 0.1, "the same"),
        (1.0, 1.6, 0.1, "slower"),
    ],
)
def test_noise_is_not_called_a_change(before, now, spread, verdict):
    old, new = (made({"a": (value, spread, 0, ())}) for value in (before, now))
    change = changes(new, old)["a"]
    assert change.ratio == pytest.approx(now / before)
    assert change.verdict == verdict
    assert change.noise == pytest.approx(max(0.05, 3 * np.sqrt(2) * spread))


def test_what_cannot_be_compared_is_not():
    old = made({"a": (1.0, 0.0, 0, ()), "b": (1.0, 0.0, 0, ())})
    new = made({"a": (2.0, 0.0, 0, ()), "b": (2.0, 0.0, 0, ()), "c": (1.0, 0.0, 0, ())})
    new["a"].attrs["amount"] = 10.0
    assert {name: change.verdict for name, change in changes(new, old).items()} == {
        "a": "measured otherwise",
        "b": "slower",
        "c": "new",
    }
    assert changes(made({"b": (2.0, 0.0, 0, ())}, rounds=2), old)["b"].verdict == "too few samples"


def test_another_machine_is_said():
    old, new = made(ROOF), made(ROOF, machine_processor="b")
    assert differences(new, old) == ["processor: b, before a"]
    assert not differences(old, old)
    assert differences(made(ROOF, machine_load_1_minute=3.5), old) == ["load of a busy machine: 3.5, before 0"]
    page = report.page(new.assign_attrs(FULL_TOLD), old.assign_attrs(FULL_TOLD), "now", "then")
    assert "Not the same machine or versions" in page
    assert "processor: b, before a" in page


def test_the_last_whole_bench_is_what_others_are_compared_with(tmp_path):
    for name in ("2026-01-01T000000Z", "2026-01-03T000000Z", "2026-01-04T000000Z-part", "2026-01-02T000000Z-quick"):
        (tmp_path / f"{name}.h5").touch()
    assert last_in(tmp_path).stem == last_in(tmp_path, PART).stem == "2026-01-03T000000Z"
    assert last_in(tmp_path, "-quick").stem == "2026-01-02T000000Z-quick"
    assert last_in(tmp_path / "none") is None
    assert path_for(tmp_path).match("????-??-??T??????Z.h5")


# The real thing where it is not this process.


def test_a_process_that_fails_is_told():
    with pytest.raises(StiffdiceError, match=r"exit status 2.*lissting"):
        cold.run_all([cold.command("lissting")])


@pytest.mark.long
def test_help_and_imports_run():
    cases = {case.name: case for case in cold.cases(QUICK)}
    for name in ("help", "import_simulate", "import_sweep"):
        cases[name].prepare()()


@pytest.mark.broad
@pytest.mark.workflow
def test_the_jobs_of_a_sweep_run(monkeypatch):
    monkeypatch.chdir(ROOT)
    (case,) = (case for case in jobs.cases(QUICK) if case.name == "one_shard")
    case.prepare()()


@pytest.mark.skipif(shutil.which(octave.PROGRAM) is None, reason="GNU Octave is not installed")
@pytest.mark.long
def test_the_throw_in_octave_is_the_throw():
    """Through the first landing at 5 ms a step, where the kernel adds in the same order."""
    steps, h = 400, 5e-3
    scene = scene_of("ungated", round(steps * h / 1e-4))
    place = octave.Throw(scene, steps).go()
    states = ready("symplectic_euler", scene, "tumbling", steps, 1)()().states
    launch = states[0]["position"] + scene.duration * np.array([5, 0, 5 - 9.8 * scene.duration / 2])
    assert abs(place[2] - launch[2]) > 1  # it landed
    np.testing.assert_allclose(place, states[-1]["position"], rtol=1e-9)


@pytest.mark.broad
def test_what_a_file_holds_can_be_looked_at(last, capsys):
    assert main(["inspect", str(last)]) == 0
    told = capsys.readouterr().out
    assert "wall time of a step: throw, gated: kernel in the listings' order" in told
    assert isinstance(open_file(last), xr.Dataset)
