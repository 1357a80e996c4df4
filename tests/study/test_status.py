"""How far a study is, told from a folder with the files and logs that a run leaves."""

from __future__ import annotations

import json
import os
import re
import shutil
import statistics
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import pytest

from stiffdice.cli import main as cli
from stiffdice.cli import status as command
from stiffdice.errors import InputError
from stiffdice.io import seal
from stiffdice.study import config as studies
from stiffdice.study import forecast, job_log, outputs, status
from stiffdice.study.job_log import digest_of
from stiffdice.study.status import State
from stiffdice.sweep import partition

ROOT = Path(__file__).parents[2]
LATER = 2_000_000_000  # s since the epoch


@pytest.fixture(scope="module")
def study():
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        return studies.load("config/quick.yaml", "workflow/schemas/study.schema.yaml")


class Made:
    """A folder of results, made up."""

    def __init__(self, study, folder):
        self.study, self.folder, self.asked = study, folder, outputs.asked(study, ROOT)
        for result in outputs.of(study):
            self.make(result)

    def named(self, stage, number=0):
        return [result for result in outputs.of(self.study) if result.stage == stage][number]

    def make(self, result, seconds=10.0):
        for file in result.files:
            content = b"x" * (1000 - seal.LENGTH)
            self._path(file).write_bytes(content + seal.line_of(content))
        cells = [job_log.cells(200, 1600)] if result.stage == "shard" else []
        self.log(result, job_log.begun(), *self.words(result), *cells, job_log.done(seconds))
        self._path(result.benchmark).write_text(f"s\th:m:s\tmax_rss\n{seconds}\t0:00:10\t99.5\n")

    def words(self, result):
        """What a log says of a result that is as it should be."""
        digests = [job_log.made(file, digest_of(self.folder / file)) for file in result.files]
        return [job_log.asked(self.asked[result]), *digests]

    def log(self, result, *lines):
        self._path(result.log).write_text("".join(f"{line}\n" for line in lines))

    def unmake(self, result, *, benchmark=True):
        for file in (*result.files, result.log, *([result.benchmark] if benchmark else [])):
            (self.folder / file).unlink()

    def _path(self, file):
        path = self.folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def look(self, **options):
        return status.of(self.study, self.folder, **options)

    def standing(self, result):
        (found,) = [standing for standing in self.look().standings if standing.result == result]
        return found


@pytest.fixture
def made(study, tmp_path):
    return Made(study, tmp_path / "quick")


@pytest.fixture(scope="module")
def gone():
    """The number of a process that has ended."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    return ended.pid


def by(process, host=None):
    """Return the first line of the log of another process."""
    words = job_log.begun().split()
    return " ".join([*words[:4], str(process), "on", host or words[-1]])


def test_nothing_is_there_at_first(study, tmp_path):
    found = status.of(study, tmp_path / "nowhere")
    (sweep,) = study.sweeps.values()
    first = sum(len(sweep.scan(column)) for column in sweep.columns())
    assert {standing.state for standing in found.standings} == {found.state} == {State.WAITING}
    assert found.cells["steps-needed"] == (first, 0, 0, 0, 0, True)
    assert 5 < found.left < 300  # foretold
    assert found.cores == 1
    assert found.use.total == 0
    assert {standing.result.stage for standing in found.ready} == {"trajectory", "shard"}


def test_all_is_done_at_last(made):
    found = made.look()
    assert found.state is State.DONE
    count = len(plan_of(made))
    assert found.cells["steps-needed"] == (200 * count, 200 * count, 0, 0, 1600 * count, False)
    assert (found.left, found.cores) == (0, 1)
    assert status.failures(found) == ""
    assert (found.use.kinds["shards"], found.use.stale) == (1000 * count, {})


@pytest.mark.parametrize(
    ("lines", "state", "reason"),
    [
        ([job_log.begun(), job_log.failed(InputError("no scene"))], State.FAILED, "no scene"),
        ([job_log.begun(), job_log.failed(ZeroDivisionError()), "", "Traceback:"], State.FAILED, "a mistake in the"),
        ([job_log.begun(), job_log.interrupted("SIGTERM")], State.INTERRUPTED, "told to stop (SIGTERM)"),
        ([job_log.begun()], State.RUNNING, ""),
        ([by(1, "elsewhere")], State.RUNNING, "on elsewhere: whether it still runs is not known here"),
        (
            [f"begun 2001-01-01T00:00:00Z by process {os.getpid()} on {job_log.begun().split()[-1]}"],
            State.INTERRUPTED,
            "",
        ),
        ([], State.INTERRUPTED, "its log is empty"),
        ([job_log.begun(), job_log.done(1)], State.WAITING, ""),  # somebody has removed what it made
        (["100% of the steps done", "simulation: 1.0 s"], State.WAITING, ""),  # as logs once were
    ],
)
def test_a_log_says_how_it_stands_with_what_is_not_there(made, lines, state, reason):
    shard = made.named("shard")
    made.unmake(shard)
    made.log(shard, *lines)
    found = made.standing(shard)
    assert found.state is state
    assert found.reason.startswith(reason)


def test_a_job_that_was_killed_is_told_from_one_that_runs(made, gone):
    shard = made.named("shard")
    made.unmake(shard)
    made.log(shard, by(gone), job_log.tenth(0.5))
    found = made.standing(shard)
    assert found.state is State.INTERRUPTED
    assert found.reason.startswith("ended without a word; killed?")


@pytest.mark.parametrize("lines", [[], [job_log.begun()], [job_log.failed(InputError("old"))], ["1 shards collected"]])
def test_files_that_are_newer_than_a_log_are_done_whatever_it_says(made, lines):
    """As after a restore; and of a job whose last word found no room on the disk."""
    for result in outputs.of(made.study):
        made.log(result, *lines, *made.words(result))
        for file in result.files:
            os.utime(made.folder / file, (LATER, LATER))
    assert made.look().state is State.DONE


def test_a_job_without_a_last_word_is_done_if_what_it_should_make_is_newer_than_its_first(made, gone):
    """There was no room for the word; files appear whole, or not at all."""
    shard = made.named("shard")
    made.log(shard, by(gone), *made.words(shard), "simulation: 1.0 s")
    os.utime(made.folder / shard.files[0], (LATER, LATER))
    os.utime(made.folder / shard.log, (LATER + 1, LATER + 1))
    assert made.standing(shard).state is State.DONE


def test_a_failure_after_a_success_is_a_failure(made):
    frontier = made.named("frontier")
    made.log(frontier, job_log.begun(), job_log.failed(InputError("damaged")))
    os.utime(made.folder / frontier.log, (LATER, LATER))
    assert made.standing(frontier)[1:3] == (State.FAILED, "damaged")


def test_a_folder_in_the_way_is_told(made):
    shard = made.named("shard")
    (made.folder / shard.files[0]).unlink()
    (made.folder / shard.files[0]).mkdir()
    found = made.standing(shard)
    assert found.state is State.FAILED
    assert found.reason.endswith(f"{shard.files[0]}: is in the way: not a regular file")


def test_results_without_logs_are_stale(made):
    """Nothing says what was asked of them."""
    shutil.rmtree(made.folder / "logs")
    found = made.look()
    assert {standing.state for standing in found.standings} == {State.STALE}
    assert found.cells["steps-needed"].at_least  # no log says how many cells refined scans have


def test_what_stands_on_a_failure_is_not_done(made):
    """Though its files are there: they will be made again."""
    shard = made.named("shard", 1)
    made.unmake(shard)
    made.log(shard, job_log.begun(), job_log.failed(InputError("no room")))
    found = made.look()
    assert found.state is State.FAILED
    assert [f"{part.result.stage} {part.result.name}" for part in found.stuck] == [
        "survey steps-needed/0",
        *(f"shard steps-needed/{name}" for name in partition.rounds(plan_of(made), 1)),
        *("collect steps-needed", "frontier steps-needed", "figure frontier"),
    ]
    assert found.ready == []
    done = 200 * (len(partition.rounds(plan_of(made), 0)) - 1)
    assert found.cells["steps-needed"][1:5] == (done, 0, found.cells["steps-needed"].planned - done, 8 * done)
    told = status.failures(found)
    assert f"shard {shard.name}  no room\n    log: results/quick/{shard.log}\n" in told
    assert "not made because of that: survey steps-needed/0, shard steps-needed/" in told
    assert ", collect steps-needed, frontier steps-needed, figure frontier" in told


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        ([job_log.asked("scene 0 plan 0 code 0 inputs 0")], "made from other scene, plan, code, inputs"),
        ([], "no log says what it was made from"),
    ],
)
def test_what_was_asked_otherwise_is_stale_until_it_is_made_again(made, lines, reason):
    frontier = made.named("frontier")
    made.log(frontier, job_log.begun(), *lines, job_log.done(1))
    found = made.look()
    assert (made.standing(frontier).state, made.standing(frontier).reason) == (State.STALE, reason)
    assert [standing.result.name for standing in found.those(State.WAITING)] == ["frontier"]  # the figure of it
    assert found.state is State.STALE
    assert f"\n  frontier steps-needed  {reason}\n" in status.as_text(found)
    assert status.as_data(found)["results"]["stale"] == 1
    assert command._exit_status([found]) == 3
    made.make(frontier)
    assert made.look().state is State.DONE


def test_what_its_job_did_not_make_is_stale(made):
    shard, figure, run = (made.named(stage) for stage in ("shard", "figure", "trajectory"))
    shutil.copy(made.folder / made.named("collect").files[0], made.folder / shard.files[0])
    assert made.standing(shard).state is State.DONE  # the same content
    (made.folder / shard.files[0]).write_bytes(b"y" + seal.line_of(b"y"))
    (made.folder / figure.files[1]).write_bytes(b"touched up")
    made.log(run, job_log.begun(), job_log.asked(made.asked[run]), job_log.done(1))
    words = "is not what its job made: another file in its place, or changed by hand"
    assert made.standing(shard)[1:3] == (State.STALE, f"its .h5 {words}")
    assert made.standing(figure)[1:3] == (State.STALE, f"its .png {words}")
    assert made.standing(run)[1:3] == (State.STALE, "no log says that its job made it")


def test_what_nobody_says_why_is_told(made):
    made.unmake(made.named("figure"))
    assert status.failures(made.look()) == "  not made, and no log says why: figure position"


def test_needs_are_as_the_workflow_has_them(study):
    names = {
        f"{result.stage} {result.name}": {f"{part.stage} {part.name}" for part in below}
        for result, below in outputs.needs(study).items()
    }
    plan = partition.of(study.sweeps["steps-needed"])
    first, second = ({f"shard steps-needed/{shard}" for shard in partition.rounds(plan, number)} for number in (0, 1))
    assert {name: below for name, below in names.items() if below} == {
        **{shard: {"survey steps-needed/0"} for shard in second},
        "survey steps-needed/0": first,
        "collect steps-needed": {*first, *second, "survey steps-needed/0"},
        "frontier steps-needed": {"collect steps-needed"},
        "figure frontier": {"frontier steps-needed"},
        "figure position": {"trajectory figure-04.as_listed", "trajectory figure-04.as_written"},
        "figure energy": {"trajectory figure-09.as_listed", "trajectory figure-09.as_written"},
    }


@pytest.mark.parametrize("name", sorted(path.stem for path in (ROOT / "config").glob("*.yaml")))
@pytest.mark.long
def test_every_study_of_the_project_can_be_told(name, monkeypatch, tmp_path):
    monkeypatch.chdir(ROOT)
    found = status.of(studies.load(f"config/{name}.yaml", "workflow/schemas/study.schema.yaml"), tmp_path)
    for told in (status.as_text(found), status.as_line(found), json.dumps(status.as_data(found))):
        assert told.startswith(name) or f'"study": "{name}"' in told


def test_running_shards_count_by_their_tenths(made):
    first, second = made.named("shard"), made.named("shard", 1)
    for shard, share in ((first, 0.5), (second, 0.25)):
        made.unmake(shard, benchmark=False)
        made.log(shard, job_log.begun(), job_log.tenth(0.1), job_log.tenth(share))
    cells = made.look().cells["steps-needed"]
    plan = made.study.sweeps["steps-needed"]
    sizes = [sum(len(piece.steps) for piece in shard.pieces) for shard in partition.of(plan).values()]
    assert sizes[2:] == [0]  # in the second round, of which nothing is known yet
    assert cells.planned == sizes[0] + sizes[1]
    assert cells.at_least
    assert cells.done == sizes[0] * 0.5 + sizes[1] * 0.25
    assert cells.done + cells.running == cells.planned
    assert cells.runs == 0


def test_the_time_left_is_that_of_like_jobs(made):
    made.unmake(made.named("shard"))
    made.unmake(made.named("trajectory"))
    found = made.look(cores=1)
    # A shard and all of the next round, survey, collect, frontier and the figure; a trajectory and its figure.
    weights = forecast.seconds(made.study)
    shards = [made.named("shard", number) for number in range(len(plan_of(made)))]
    rate = statistics.median(10 / weights[shard] for shard in shards[1:])
    later = sum(shard.round > 0 for shard in plan_of(made).values())
    assert found.left == pytest.approx(weights[shards[0]] * rate + 10 + 10 * (later + 5), rel=0.2)


def plan_of(made):
    return partition.of(made.study.sweeps["steps-needed"])


def test_while_a_run_is_under_way_what_it_cannot_make_takes_no_time(made):
    shard, run = made.named("shard"), made.named("trajectory")
    made.unmake(shard, benchmark=False)
    made.log(shard, job_log.begun(), job_log.failed(InputError("no room")))
    assert made.look(cores=1).left == pytest.approx(60)
    made.unmake(run, benchmark=False)
    made.log(run, job_log.begun())
    found = made.look(cores=1)
    (running,) = found.those(State.RUNNING)
    elapsed = (found.when - running.log.begun).total_seconds()
    assert found.left == pytest.approx(20 - elapsed, abs=0.5)  # the run and its figure


@pytest.fixture
def project(made, tmp_path, monkeypatch, capsys):
    """Call the command in a project with these results; return its exit status and what it printed."""
    (tmp_path / "results").mkdir()
    made.folder.rename(tmp_path / "results" / "quick")
    made.folder = tmp_path / "results" / "quick"
    shutil.copytree(ROOT / "config", tmp_path / "config")
    (tmp_path / "workflow").symlink_to(ROOT / "workflow")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "SECONDS", 0.01)

    def call(*arguments):
        ended = cli.main(["status", *arguments])
        return ended, *capsys.readouterr()

    call.made = made
    return call


@pytest.mark.long
def test_the_exit_status_says_how_it_stands(project):
    shard = project.made.named("shard")
    assert project("quick")[0] == project()[0] == 0
    project.made.unmake(shard)
    assert project("quick")[0] == project()[0] == 3
    assert project("paper")[0] == 3
    project.made.log(shard, job_log.begun(), job_log.failed(InputError("no room")))
    assert project("quick")[0] == project()[0] == 1


def test_studies_without_results_are_not_listed(project):
    assert re.fullmatch(r"quick: 13 of 13 done; [0-9.]+ kB\n", project()[1])
    shutil.rmtree("results")
    assert project() == (3, "no study has results yet; `make study STUDY=quick` makes some\n", "")


def test_the_page_says_it_all(project, gone):
    shard, run = project.made.named("shard"), project.made.named("trajectory")
    for result in (shard, run):
        project.made.unmake(result)
    project.made.log(shard, job_log.begun(), job_log.failed(InputError("no room")))
    project.made.log(run, job_log.begun(), job_log.tenth(0.4))
    for process in (os.getpid(), gone):
        (project.made.folder / "runs" / f".x.h5.{process}.part").write_bytes(b"x" * 2000)
    (project.made.folder / Path(shard.files[0]).parent / "0123456789ab.h5").write_bytes(b"x" * 3000)
    (project.made.folder / "runs" / "y.h5.damaged").write_bytes(b"x" * 4000)
    page = project("quick")[1]
    for told in (
        "results     5 of 13 done, 1 running, 1 failed, 6 waiting\n",
        "shard       1 of 3 done, 1 failed, 1 waiting\n",
        f"running\n  trajectory {run.name}  for ",
        ", 40% done\n",
        f"failed\n  shard {shard.name}  no room\n    log: results/quick/{shard.log}\n",
        ", collect steps-needed, frontier steps-needed, figure frontier\n",
        "stale       shards of other grids: 1, 3 kB\n",
        ", unfinished 4 kB",
        f"leftover    runs/.x.h5.{gone}.part 2 kB, of a process that does not run on this host\n",
        "damaged     runs/y.h5.damaged 4 kB, set aside\n",
    ):
        assert told in page


def test_programs_get_the_same_numbers(project):
    shard = project.made.named("shard")
    project.made.unmake(shard)
    project.made.log(shard, job_log.begun(), job_log.failed(InputError("no room")))
    ended, out, _ = project("quick", "--json")
    data = json.loads(out)
    assert (ended, data["state"]) == (1, "failed")
    assert data["results"] == {"done": 7, "running": 0, "interrupted": 0, "failed": 1, "stale": 0, "waiting": 5}
    (failed,) = [job for job in data["jobs"] if job["state"] == "failed"]
    assert (failed["name"], failed["reason"], failed["files"]) == (shard.name, "no room", list(shard.files))
    assert datetime.fromisoformat(failed["begun"]) <= datetime.now(UTC)
    assert data["bytes"]["total"] == sum(
        path.stat().st_size for path in Path("results/quick").rglob("*") if path.is_file()
    )
    assert [json.loads(project("--json")[1])["studies"][0][key] for key in ("state", "cells")] == [
        data["state"],
        data["cells"],
    ]


def test_watching_ends_when_all_is_done(project):
    assert project("quick", "--watch")[0] == 0
    lines = project("quick", "--watch", "--json")[1].splitlines()
    assert [json.loads(line)["state"] for line in lines] == ["done"]


@pytest.mark.long
def test_watching_ends_when_the_run_has_ended(project, monkeypatch):
    """Not between two of its jobs."""
    made, run = project.made, project.made.named("trajectory")
    made.unmake(run)
    acts = [
        lambda: made.log(run, job_log.begun()),
        (made.folder / run.log).unlink,
        lambda: made.log(run, job_log.begun()),
        lambda: made.log(run, job_log.begun(), job_log.failed(InputError("no room"))),
    ]
    monkeypatch.setattr(command.time, "sleep", lambda seconds: acts.pop(0)() if acts else None)
    ended, out, _ = project("quick", "--watch", "--json")
    states = [json.loads(line)["state"] for line in out.splitlines()]
    assert states == ["waiting", "running", "waiting", "running"] + ["failed"] * command.QUIET
    assert ended == 1


def test_ctrl_c_ends_watching_as_it_stands(project, monkeypatch):
    def stop(seconds):
        raise KeyboardInterrupt

    project.made.unmake(project.made.named("trajectory"))
    monkeypatch.setattr(command.time, "sleep", stop)
    ended, out, err = project("quick", "--watch")
    assert (ended, err) == (3, "")
    assert "11 of 13 done, 2 waiting" in out  # the run and its figure


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["nowhere"], "config/nowhere.yaml: there is no study nowhere; those in config/ are "),
        (["qick"], "; did you mean quick?"),
        (["../quick"], "STUDY = ../quick: allowed is the name of a file in config/, without .yaml"),
        (["quick", "--cores", "0"], "--cores = 0: allowed is a whole number from 1"),
    ],
)
def test_bad_input_is_one_line(project, arguments, told):
    ended, out, err = project(*arguments)
    assert (ended, out) == (2, "")
    assert told in err
    assert err.count("\n") == 1


def test_outside_of_a_project_it_says_so(project, monkeypatch, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert project("quick")[0] == 2
    assert "in the project's folder" in project()[2]


@pytest.fixture
def write(tmp_path):
    def write(name, size):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"x" * size)

    return write


def test_every_byte_is_counted_once(tmp_path, write):
    sizes = {"runs/a.h5": 1, "sweeps/s/shards/b.h5": 20, "sweeps/s/sweep.h5": 300, "logs/shard/s/b.log": 4000}
    sizes |= {"report.html": 50_000, "strange/c": 600_000, "sweeps/s/shards/old.h5": 7_000_000}
    for name, size in sizes.items():
        write(name, size)
    use = status.use_of(tmp_path, {"sweeps/s/shards/b.h5"})
    assert use.kinds == {"runs": 1, "shards": 7_000_020, "sweeps": 300, "logs": 4000, "other": 650_000}
    assert use.total == sum(sizes.values())
    assert use.stale == {"sweeps/s/shards/old.h5": 7_000_000}


def test_what_is_no_result_is_named(tmp_path, write, gone):
    mine, theirs = (f"runs/.a.h5.{process}.part" for process in (os.getpid(), gone))
    write(mine, 3)
    write(theirs, 5)
    write("sweeps/s/shards/b.h5.damaged", 7)
    use = status.use_of(tmp_path, set())
    assert (use.kinds["unfinished"], use.leftover) == (8, {theirs: 5})
    assert (use.damaged, use.stale) == ({"sweeps/s/shards/b.h5.damaged": 7}, {})
    assert use.total == 15


def test_links_are_not_followed(tmp_path, write):
    write("runs/a.h5", 1000)
    (tmp_path / "runs" / "loop").symlink_to(tmp_path)
    (tmp_path / "runs" / "b.h5").symlink_to("a.h5")
    assert status.use_of(tmp_path, set()).total < 2000


def test_no_folder_takes_nothing(tmp_path):
    assert status.use_of(tmp_path / "nowhere", set()).total == 0
