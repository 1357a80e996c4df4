"""A sweep on a real Slurm of two nodes, undisturbed and with things killed: its data are those of one machine."""

from __future__ import annotations

import contextlib
import re
import signal
import time
from pathlib import Path

import pytest
from tests.slurm.cluster import Cluster, run, send, until
from tests.slurm.conftest import Project, Run

AWAY = 12.0  # seconds that the controller is gone: longer than the time-outs of cluster.py
# Where it is the shards that are disturbed, what stands on them would only take its time.
SHARDS_ONLY = "--until=shard"
# Measured alone on its node; small, as is all that is timed here.
FEW = {"stiffness": [100], "per_decade": 1, "methods": ["symplectic_euler"], "affordable": 0.01, "rounds": 1}
TIMED = {"measure": "work-precision", "scene": "config/scenes/figure-01.yaml", "set": ["duration=3"], "options": FEW}


@pytest.fixture(autouse=True)
def idle(cluster):
    """No job is left of the test before."""
    until("no job is left", lambda: not run("squeue", "--noheader"), 60)


@pytest.fixture
def project(tmp_path) -> Project:
    """A project whose study has not begun."""
    return Project(tmp_path / "project")


def job_of(part: Path) -> tuple[str, int, str]:
    """Return the Slurm job, the process and the node that write an unfinished file."""
    *_, place, process, _ = part.name.split(".")
    node = place.partition("-")[0]  # what follows is its namespace
    environment = Path(f"/proc/{process}/environ").read_bytes().decode()
    return re.search(r"\0SLURM_JOB_ID=([0-9]+)\0", environment)[1], int(process), node


def jobs(names: str) -> list[list[str]]:
    """Return columns of sacct for all jobs so far."""
    told = run("sacct", "--allocations", "--noheader", "--parsable2", "--duplicates", f"--format={names}")
    return [line.split("|") for line in told.splitlines()]


def failures(said: str) -> list[str]:
    """Return the lines that tell of failed jobs."""
    return [line for line in said.splitlines() if line.startswith("stiffdice: results/")]


def ends_well(started: Run, project: Project, local: dict[str, bytes]) -> str:
    """See that a run ends by itself with the data of the local run and nothing else, and return what it said."""
    said = started.end()
    until("no job is left", lambda: not run("squeue", "--noheader"), 60)
    made = project.data()
    assert made == {name: data for name, data in local.items() if name in made}
    assert SHARDS_ONLY in started.process.args or made.keys() == local.keys()
    return said


def test_what_nodes_make_is_what_this_machine_makes(project, local):
    assert not failures(ends_well(project.start(), project, local))
    ours = jobs("Comment,NodeList,AllocCPUS,State")
    assert {node for comment, node, *_ in ours if comment.startswith("rule_shard")} == {"n1", "n2"}
    assert {(cpus, state) for *_, cpus, state in ours} == {("1", "COMPLETED")}


def test_timings_have_a_node_of_their_own(tmp_path):
    timed = Project(tmp_path / "timed", {"question": "How long?", "timings": {"few": TIMED}})
    timed.start().end()
    assert [cpus for comment, cpus in jobs("Comment,AllocCPUS") if comment.startswith("rule_timing")] == ["2"]


def test_a_job_that_is_cancelled_or_killed_is_sent_again(project, local):
    started = project.start()
    part = project.shards_at_work()[0]
    cancelled, _, _ = job_of(part)
    run("scancel", cancelled)
    until("what it wrote is gone", lambda: not part.exists(), 30)
    part = project.shards_at_work()[0]
    killed, process, node = job_of(part)
    with drained(node):  # so that another host finds what the killed one left
        send(signal.SIGKILL, process)
        told = failures(ends_well(started, project, local))
    reasons = {cancelled: "'CANCELLED'", killed: "'FAILED'"}
    assert len(told) == 2
    assert all(any(job in line and reason in line for line in told) for job, reason in reasons.items())


@contextlib.contextmanager
def drained(node: str):
    """Send no more jobs to a node for a while."""
    run("scontrol", "update", f"nodename={node}", "state=drain", "reason=test")
    try:
        yield
    finally:
        run("scontrol", "update", f"nodename={node}", "state=resume")


def waiting() -> list[str]:
    """Return the jobs that have their time still to come."""
    queue = [line.split() for line in run("squeue", "--noheader", "--format=%i %r").splitlines()]
    return [job for job, reason in queue if reason == "BeginTime"]


def test_what_a_lost_node_was_at_is_begun_again_elsewhere(cluster: Cluster, project, local):
    started = project.start()
    job, _, node = job_of(project.shards_at_work()[0])
    cluster.lose_node(node)
    try:
        # Slurm waits for two minutes before it begins them again, which are an operator's to cut short.
        until("its jobs are back in the queue", waiting, 120)
        for left in waiting():
            run("scontrol", "update", f"jobid={left}", "starttime=now")
        assert not failures(ends_well(started, project, local))
    finally:
        cluster.start_node(node)
    restarted = [(where, state) for number, where, state in jobs("JobIDRaw,NodeList,State") if number == job]
    assert (node, "NODE_FAIL") in restarted and any(
        where != node and state == "COMPLETED" for where, state in restarted
    )


def test_daemons_may_be_restarted(cluster: Cluster, project, local):
    started = project.start("slurm", SHARDS_ONLY)
    _, _, node = job_of(project.shards_at_work()[0])
    cluster.stop_node(node)
    cluster.stop_controller()
    time.sleep(AWAY)
    cluster.start_node(node)
    cluster.start_controller()
    assert not failures(ends_well(started, project, local))


def test_the_controller_may_be_away_where_nobody_keeps_accounts(cluster: Cluster, project, local):
    with without_accounting(cluster):
        started = project.start("slurm", SHARDS_ONLY)
        project.shards_at_work()
        cluster.stop_controller()
        time.sleep(AWAY)
        cluster.start_controller()
        assert "watched with squeue" in ends_well(started, project, local)


@contextlib.contextmanager
def without_accounting(cluster: Cluster):
    """Have the controller keep no accounts for a while."""
    cluster.restart_controller(accounting=False)
    try:
        yield
    finally:
        cluster.restart_controller(accounting=True)


def test_ctrl_c_cancels_what_was_sent(project):
    started = project.start()
    parts = project.shards_at_work()
    started.process.send_signal(signal.SIGINT)
    assert started.process.wait(60) != 0
    until("no job is left", lambda: not run("squeue", "--noheader"), 30)
    assert not [part for part in parts if part.exists()], started.said()


def test_a_job_that_needs_more_memory_gets_it(project, local):
    rules = project.folder / "workflow" / "rules" / "common.smk"
    growing = "amount * 2 ** (attempt - 1)"
    assert growing in rules.read_text()
    rules.write_text(rules.read_text().replace(growing, "amount // 9 * 2 ** (attempt - 1)"))  # too little at first
    shards = sorted(name for name in local if "/shards/" in name)
    said = project.start("slurm", SHARDS_ONLY, f"--jobs={len(shards)}").end()
    asked = [memory for comment, memory in jobs("Comment,ReqMem") if comment.startswith("rule_shard_wildcards_small")]
    assert len(failures(said)) >= len(shards)
    assert {"100M", "200M"} <= set(asked)
    assert [name for name in sorted(project.data()) if "/shards/" in name] == shards


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ("slurm_partition=fast", "stiffdice: sbatch --partition=fast: .*Invalid partition name specified"),
        ("slurm_account=nobody", "stiffdice: sbatch --account=nobody: .*Invalid account"),
    ],
)
def test_what_the_profile_has_wrong_is_told_before_a_job_is_sent(project, given, line):
    started = project.start("slurm", "--default-resources", given)
    assert started.process.wait(60) == 2, started.said()
    assert re.fullmatch(f"{line}.*", started.said().splitlines()[-1]), started.said()
