"""What others left in a project: links to nowhere, another user's files, rubbish in Snakemake's notes, containers."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from tests.forks import run_module

from stiffdice.io import host
from stiffdice.io.writer import whole

pytestmark = pytest.mark.workflow


def status(project) -> subprocess.CompletedProcess[str]:
    return run_module("stiffdice.cli", "status", "small", cwd=project.folder, environment=project.environment)


WITHOUT = "-dac_override,-dac_read_search,-fowner,-chown"
BOUND = ["setpriv", "--bounding-set", WITHOUT, "--inh-caps", WITHOUT]


def may_be_bound() -> bool:
    """Return whether this is root, who can give files away, and can do without its rights on others' files."""
    try:
        return os.geteuid() == 0 and subprocess.run([*BOUND, "true"], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


@pytest.mark.long
def test_a_result_that_is_a_link_to_nowhere_is_one_line_and_such_a_log_gives_way(undisturbed, tmp_path):
    """So do logs and benchmarks of another user, where this is root, who can give files away."""
    project, bound = undisturbed.copy(tmp_path / "project"), may_be_bound()
    figure = project.results / "figures/position.svg"
    figure.unlink()
    figure.symlink_to("/nowhere/position.svg")
    told = (
        "results/small/figures/position.svg: a link to /nowhere/position.svg, which is not there; "
        "bring that back, or remove the link"
    )
    assert told in status(project).stdout
    words = ("--cores", "2", "study", "--config", "study=small")
    done = run_module("snakemake", *words, cwd=project.folder, environment=project.environment)
    assert done.returncode == 2
    assert f"stiffdice: {told}\n" in done.stderr and "Traceback" not in done.stderr
    figure.unlink()
    for stage, name in (("trajectory", "stiff.as_listed"), ("experiment", "books")):
        for path in (project.results / f"logs/{stage}/{name}.log", project.results / f"benchmarks/{stage}/{name}.tsv"):
            if bound:
                os.chown(path, 65534, 65534)
            path.chmod(0o600)
    log = project.results / "logs/table/answers.log"
    log.unlink()
    log.symlink_to("/nowhere/answers.log")
    command = [*(BOUND if bound else []), *project.command()]
    done = subprocess.run(
        command, cwd=project.folder, env=project.environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    assert project.data() == undisturbed.data()
    assert log.is_file() and not log.is_symlink()


@pytest.mark.long
def test_rubbish_among_the_notes_of_snakemake_is_forgotten(undisturbed, tmp_path):
    project = undisturbed.copy(tmp_path / "project")
    notes = [path for path in (project.folder / ".snakemake/metadata").rglob("*") if path.is_file()]
    assert len(notes) > 4
    for number, path in enumerate(notes):
        path.write_bytes((path.read_bytes()[:50], b"\x93\xff\0", b"", b"[1, 2]")[number % 4])
    (project.folder / ".snakemake/incomplete/cnVi").write_bytes(b"\x93\xff\0")
    done = project.run()
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Nothing to be done" in done.stdout + done.stderr
    assert project.data() == undisturbed.data()


CONTAINER = ["unshare", "--pid", "--fork"]


def may_unshare() -> bool:
    try:
        return subprocess.run([*CONTAINER, "true"], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


unshared = pytest.mark.skipif(not may_unshare(), reason="namespaces of processes are not allowed here")


def in_container(code: str, *arguments: object, **options: object) -> subprocess.Popen[str]:
    command = [*CONTAINER, sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True, **options)


WRITES = "import sys; from stiffdice.io.writer import write_bytes; write_bytes(b'theirs', sys.argv[1])"


@unshared
def test_what_is_being_written_here_is_not_removed_by_another_container(tmp_path):
    target = tmp_path / "x.h5"
    with whole(target) as part:
        part.write_bytes(b"ours")
        with in_container(WRITES, target) as theirs:
            assert theirs.wait() == 0
        assert target.read_bytes() == b"theirs"
        assert part.is_file()
    assert target.read_bytes() == b"ours"
    assert [path.name for path in tmp_path.iterdir()] == ["x.h5"]


HOLDS = """
import sys
from pathlib import Path
sys.path.append(sys.argv[1])
import lock
try:
    lock.hold(Path(sys.argv[2]), "small")
    print("held", flush=True)
except lock.RunningError as error:
    print(error, flush=True)
input()
"""


@unshared
def test_a_study_that_another_container_makes_is_not_made_here(tmp_path):
    """Though both processes have the same number."""
    workflow = Path(__file__).parents[2] / "workflow"
    with in_container(HOLDS, workflow, tmp_path) as first, in_container(HOLDS, workflow, tmp_path) as second:
        assert sorted([first.stdout.readline()[:20], second.stdout.readline()[:20]]) == [
            "held\n",
            "small is being made ",
        ]
        for process in (first, second):
            process.communicate("\n")


def test_outside_of_containers_a_host_has_its_own_name():
    assert host.name().startswith(os.uname().nodename)
