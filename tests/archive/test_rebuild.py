from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import psutil
import pytest
import yaml
from tests.archive import sandboxes

from stiffdice import __version__
from stiffdice.archive import contents, manifest
from stiffdice.archive import rebuild as rebuilding
from stiffdice.archive.rebuild import ARCHIVED, REBUILT, RunError, opened, other_versions, rebuild, way_of
from stiffdice.archive.sandbox import unconfined
from stiffdice.archive.verify import CRATE
from stiffdice.cli.main import main
from stiffdice.dynamics.code_digest import PACKAGE
from stiffdice.errors import RefusedError
from stiffdice.io.reader import open_file
from stiffdice.io.writer import write_dataset
from stiffdice.report.figures import registry as figures
from stiffdice.scene.scene import load
from stiffdice.simulation import energy_budget
from stiffdice.simulation.dataset import plain_run_dataset
from stiffdice.simulation.run import simulate
from stiffdice.study import config as studies
from stiffdice.study.job_log import digest_of

ROOT = Path(__file__).parents[2]
STUDY = {
    "question": "Is it the same again?",
    "runs": {
        "fall": {
            "scene": "config/scenes/figure-09.yaml",
            "presets": ["as_written"],
            "model": "sliding",
            "steps": 400,
            "every": 1,
        }
    },
    "figures": {"position": {"draw": "position", "run": "fall", "title": "Position"}},
}
RUN = "results/tiny/runs/fall.as_written.h5"


def packed(folder: Path, path: Path) -> Path:
    """Pack a folder as an archive, with a description and a manifest."""
    for name in (CRATE, manifest.NAME):
        (folder / name).unlink(missing_ok=True)
    (folder / CRATE).write_text(json.dumps({"@graph": [{"@id": "./"}, {"@id": CRATE}]}))
    files = {file.relative_to(folder).as_posix(): file for file in sorted(folder.rglob("*")) if file.is_file()}
    digests = {name: hashlib.sha256(file.read_bytes()).hexdigest() for name, file in files.items()}
    (folder / manifest.NAME).write_text(manifest.text_of(digests))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in [*files, manifest.NAME]:
            archive.write(folder / name, name)
    return path


# A project as ours is laid out, of other code, whose workflow has one job that says what the run was given.
SNAKEFILE = """\
rule study:
    input: expand("results/{study}/{name}", study=config["study"], name=["same.txt", "runs.csv", "figures/t.svg"])

rule all_of_it:
    output: "results/{study}/same.txt", "results/{study}/runs.csv", "results/{study}/figures/t.svg"
    log: "results/{study}/logs/job.log"
    script: "scripts/job.py"
"""
JOB = """\
import os, socket, sys, time
import stiffdice

assert stiffdice.HERE == "the archive's own", stiffdice.__file__
try:
    socket.create_connection(("192.0.2.1", 80), timeout=1)
    raise SystemExit("there is a network")
except OSError:
    pass
home = os.path.expanduser("~")
assert home.startswith(os.getcwd()) and "SECRET" not in os.environ, home
for path, text in zip(snakemake.output, ("same", "1,2,3", str(time.time_ns()))):
    with open(path, "w") as file:
        file.write(text)
"""
# Leaves a process that has nothing to do with it any more, and does not end.
STUBBORN = """\
import os, signal, time
for number in (signal.SIGHUP, signal.SIGTERM, signal.SIGINT):
    signal.signal(number, signal.SIG_IGN)
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        os.execvp("sleep", ["sleep", "600"])
    os._exit(0)
time.sleep(600)
"""
RUN_PY = """\
import subprocess, sys
sys.exit(subprocess.run([sys.executable, "-m", "snakemake", *sys.argv[1:]]).returncode)
"""


@pytest.fixture
def project(tmp_path):
    """The content of a small archive whose job is no simulation."""
    texts = {
        "workflow/Snakefile": SNAKEFILE,
        "config/tiny.yaml": yaml.safe_dump({"figures": {"t": {"draw": "work-precision", "timings": ["x"]}}}),
        "requirements/requirements.lock": "numpy==0.0.1 \\\n    --hash=sha256:00\nnot-here-at-all==1.0\n",
        "results/tiny/same.txt": "same",
        "results/tiny/runs.csv": "1,2,3",
        "results/tiny/figures/t.svg": "some time",
        "results/tiny/logs/job.log": "at noon",
        "results/README.md": "results",
        "src/stiffdice/__init__.py": '__version__ = "0.0.7"\nHERE = "the archive\'s own"\n',
        "workflow/run.py": RUN_PY,
        "workflow/profiles/default/config.yaml": "nolock: true\n",
        "workflow/scripts/job.py": JOB,
    }
    folder = tmp_path / "content"
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


@pytest.mark.workflow
@pytest.mark.parametrize("in_sandbox", [pytest.param(True, marks=sandboxes.needed), False])
@pytest.mark.long
def test_it_runs_other_code_away_from_everything(project, tmp_path, monkeypatch, in_sandbox):
    """No network, no home, none of the variables of who runs it; and it says whose code gives what."""
    monkeypatch.setenv("SECRET", "leaks")
    with opened(packed(project, tmp_path / "a.zip")) as unpacked:
        assert unpacked.code.version == "0.0.7" and not unpacked.code.is_installed
        rebuilt = rebuild(unpacked, way_of(unpacked, in_sandbox))
    assert rebuilt.ok and (rebuilt.found.files, rebuilt.found.identical) == (2, 2)
    assert set(rebuilt.found.left_out) >= {"figures/t.svg", "logs/job.log"}
    assert any("the archive's lock says 0.0.1" in note for note in rebuilt.notes)
    assert "made again by the archive's own code, not the installed: 2 files are the same" in rebuilt.lines()[0]
    told = "\n".join(rebuilt.notes)
    assert f"says to be stiffdice 0.0.7, installed is {__version__}: " in told
    assert "equal files say that its own code gives them, not what this computes" in told
    assert ("could have copied the archive's results" in told) == (not in_sandbox)


@sandboxes.needed
@pytest.mark.workflow
@pytest.mark.long
def test_what_differs_is_told_and_kept(project, tmp_path, capsys):
    (project / "results/tiny/same.txt").write_text("same but for this")
    path, kept = packed(project, tmp_path / "a.zip"), tmp_path / "kept"
    assert main(["rebuild", "--yes", str(path), "-o", str(kept)]) == 1
    assert "DIFFERS, between the archive (A) and what was made again (B):\n" in (out := capsys.readouterr().out)
    assert "\nsame.txt\n  other bytes\n" in out
    assert (kept / REBUILT / "results/tiny/same.txt").read_text() == "same"
    assert (kept / ARCHIVED / "results/tiny/same.txt").read_text() == "same but for this"
    assert main(["rebuild", "--yes", str(path), "-o", str(kept)]) == 2
    assert "File exists; name a new folder" in capsys.readouterr().err


@pytest.mark.workflow
@pytest.mark.parametrize(
    ("made", "reason"),
    [
        ("pass", "only in A: same.txt"),
        (
            "p = os.path.abspath; os.symlink(p('.').replace('rebuilt', 'archived') + '/' + out, p(out))",
            "same.txt: a link, or no file",
        ),
        (
            "os.rmdir('results/tiny'); os.symlink(os.path.abspath('../archived/results/tiny'), 'results/tiny')",
            "only in A: same.txt",
        ),
    ],
)
def test_what_was_not_made_is_not_the_same(project, tmp_path, made, reason):
    """A run that does nothing, or leads to the archive's own results: neither is the same to the last bit."""
    run = f"import os\nout = 'results/tiny/same.txt'\nos.makedirs('results/tiny')\n{made}\n"
    (project / "workflow/run.py").write_text(run)
    with opened(packed(project, tmp_path / "a.zip"), tmp_path / "kept") as unpacked:
        rebuilt = rebuild(unpacked, way_of(unpacked, in_sandbox=False))
    assert not rebuilt.ok and rebuilt.found.identical == 0
    assert any(reason in line for line in rebuilt.lines())


def test_nothing_to_compare_is_not_the_same(project, tmp_path):
    for name in ("same.txt", "runs.csv", "figures/t.svg"):
        (project / "results/tiny" / name).unlink()
    (project / "workflow/run.py").write_text("")
    with opened(packed(project, tmp_path / "a.zip")) as unpacked:
        rebuilt = rebuild(unpacked, way_of(unpacked, in_sandbox=False))
    assert not rebuilt.ok and rebuilt.found.same and "there was nothing to compare" in rebuilt.notes


@pytest.mark.workflow
@pytest.mark.long
def test_a_run_that_fails_is_told_with_its_last_lines(project, tmp_path, capsys):
    (project / "workflow/scripts/job.py").write_text("raise ValueError('out of luck')")
    path = packed(project, tmp_path / "a.zip")
    with pytest.raises(RunError, match=r"(?s)exit status 1.*out of luck"), opened(path) as unpacked:
        rebuild(unpacked, way_of(unpacked, in_sandbox=False))
    (project / "workflow/run.py").write_text("raise SystemExit('cannot \\x1b[2J even start')")
    assert main(["rebuild", "--yes", "--no-sandbox", str(packed(project, path))]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].endswith("exit status 1:") and lines[-1] == r"  cannot \x1b[2J even start"


def test_what_fails_a_check_is_not_run_and_not_left_behind(project, tmp_path, capsys):
    """Nothing of an archive is executed before all of it has passed."""
    (project / "workflow/run.py").write_text(f"open({str(tmp_path / 'executed')!r}, 'w')")
    path = packed(project, tmp_path / "a.zip")
    (project / "extra").write_text("")
    with zipfile.ZipFile(path, "a") as archive:
        archive.write(project / "extra", "extra")
    assert main(["rebuild", "--yes", "--no-sandbox", str(path), "-o", str(tmp_path / "kept")]) == 2
    told = capsys.readouterr().err
    assert "extra: there, but not listed in " in told and "; not run" in told
    assert {file.name for file in tmp_path.iterdir()} == {"content", "a.zip"}


def on_terminal(answer: str, *words: str) -> tuple[int, str]:
    """Return the exit status of a rebuild that has a terminal to ask on, and what it said there."""
    ours, its = os.openpty()
    command = [sys.executable, "-m", "stiffdice.cli", "rebuild", *words]
    with subprocess.Popen(command, stdin=its, stderr=its, stdout=subprocess.DEVNULL) as asking:
        os.write(ours, answer.encode())
        status = asking.wait(60)
    told = os.read(ours, 1 << 16).decode()
    os.close(ours)
    os.close(its)
    return status, told


@pytest.mark.long
def test_other_code_is_run_only_if_somebody_says_so(project, tmp_path, capsys):
    """Without a terminal by --yes, on one by the answer; nothing of it is executed before."""
    executed = tmp_path / "executed"
    (project / "workflow/run.py").write_text(f"open({str(executed)!r}, 'w')")
    words = [str(packed(project, tmp_path / "a.zip")), "--no-sandbox"]
    assert main(["rebuild", *words, "-o", str(tmp_path / "kept")]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "nobody is here to be asked" in told and "--yes runs it without a sandbox" in told
    status, told = on_terminal("\n", *words)
    assert status == 2 and told.rstrip().endswith("a.zip: not run")
    assert "says to be stiffdice 0.0.7" in told and "without a sandbox: it can read, change and remove" in told
    assert not executed.exists() and not (tmp_path / "kept").exists()
    assert on_terminal("y\n", *words)[0] == 1 and executed.exists()


def test_without_a_sandbox_other_code_is_not_run(project, tmp_path, monkeypatch, capsys):
    path = packed(project, tmp_path / "a.zip")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["rebuild", "--yes", str(path)]) == 2
    told = capsys.readouterr().err
    assert "bubblewrap (bwrap) is not installed; --no-sandbox would let it do whatever you can" in told


@pytest.mark.long
def test_a_run_is_ended_by_an_error_of_who_waits_for_it(project, tmp_path):
    (project / "workflow/run.py").write_text(STUBBORN)

    def stop(number, frame):
        raise InterruptedError

    before = signal.signal(signal.SIGALRM, stop)
    with opened(packed(project, tmp_path / "a.zip")) as unpacked:
        way = way_of(unpacked, in_sandbox=False)
        signal.setitimer(signal.ITIMER_REAL, 2.0)
        with pytest.raises(InterruptedError):
            rebuild(unpacked, way)
    signal.signal(signal.SIGALRM, before)
    assert [child for child in psutil.Process().children(recursive=True) if str(tmp_path) in child.cwd()] == []


def all_of(running: psutil.Popen, name: str) -> list[psutil.Process]:
    """Return all that a process has started, once one of them has a name."""
    until = time.monotonic() + 60
    while running.poll() is None and time.monotonic() < until:
        found = running.children(recursive=True)
        with contextlib.suppress(psutil.NoSuchProcess):
            if name in [process.name() for process in found]:
                return found
        time.sleep(0.1)
    raise AssertionError(f"no {name} is started")


@pytest.mark.workflow
@pytest.mark.parametrize(
    ("words", "number", "status"),
    [
        pytest.param([], signal.SIGHUP, 129, marks=[sandboxes.needed, pytest.mark.broad]),
        pytest.param([], signal.SIGTERM, 143, marks=sandboxes.needed),
        pytest.param([], signal.SIGINT, 130, marks=[sandboxes.needed, pytest.mark.broad]),
        pytest.param([], signal.SIGKILL, -9, marks=[sandboxes.needed, pytest.mark.broad]),
        pytest.param(["--no-sandbox"], signal.SIGTERM, 143, marks=pytest.mark.broad),
        (["--no-sandbox"], signal.SIGKILL, -9),
    ],
)
@pytest.mark.long
def test_nothing_of_a_run_outlives_it(project, tmp_path, words, number, status):
    """However it ends, also what has left its session and pays no attention; only a kill leaves files behind."""
    if words and "leave processes behind" in unconfined(tmp_path).could:
        pytest.skip("this system gives no process namespace")
    (project / "workflow/scripts/job.py").write_text(STUBBORN)
    (temporary := tmp_path / "temporary").mkdir()
    command = ["env", "--default-signal=HUP,INT,TERM", sys.executable, "-m", "stiffdice.cli", "rebuild"]
    command += ["--yes", *words]
    running = psutil.Popen(
        [*command, str(packed(project, tmp_path / "a.zip"))],
        env=os.environ | {"TMPDIR": str(temporary)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    of_it = all_of(running, "sleep")
    running.send_signal(number)
    assert running.wait(10) == status
    _, alive = psutil.wait_procs(of_it, timeout=5)
    assert alive == []
    assert bool(list(temporary.iterdir())) == (number == signal.SIGKILL)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda top: shutil.rmtree(top / "results/tiny"), "holds results of these studies: none"),
        (lambda top: shutil.copytree(top / "results/tiny", top / "results/other"), "other, tiny; allowed is one"),
        (lambda top: (top / "results/tiny").rename(top / "results/-x"), "studies: -x"),
        (lambda top: (top / "workflow/Snakefile").unlink(), "has no workflow/Snakefile"),
        (lambda top: (top / "config/tiny.yaml").rename(top / "config/other.yaml"), "has no config/tiny.yaml"),
    ],
)
def test_what_cannot_be_made_again_is_refused(project, tmp_path, change, words):
    change(project)
    with pytest.raises(RefusedError, match=words), opened(packed(project, tmp_path / "a.zip")):
        pass


def test_a_lock_of_this_environment_has_nothing_to_tell(tmp_path):
    lock = tmp_path / "x.lock"
    lock.write_text(f"numpy=={np.__version__} \\\n    --hash=sha256:00\n")
    assert other_versions(lock) == []
    assert "not known" in other_versions(tmp_path / "none.lock")[0]


@pytest.mark.long
@pytest.mark.workflow
def test_a_study_is_the_same_again_from_its_archive_alone(tmp_path, capsys):
    """Ours: what this process computes, a workflow in another place does, to the last bit; and a forgery differs.

    The code is the installed code, so nobody is asked, and nothing else in the archive is executed.
    """
    folder = tmp_path / "content"
    for name in ("workflow", "config", "src", "requirements"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    (folder / "config/tiny.yaml").write_text(yaml.safe_dump(STUDY))
    for path in (RUN, "results/tiny/figures/x"):
        (folder / path).parent.mkdir(parents=True)
    scene = load(ROOT / "config/scenes/figure-09.yaml", preset="as_written")
    run = plain_run_dataset(simulate(scene, model="sliding", steps=400, every=1), "fall, as written")
    ledger = energy_budget.ledger(scene, model="sliding", steps=400)
    write_dataset(run.assign(ledger.data_vars), folder / RUN)
    data = {"as_written": open_file(folder / RUN)}
    drawn = [str(folder / f"results/tiny/figures/position.{suffix}") for suffix in ("svg", "png")]
    plan = studies.load(folder / "config/tiny.yaml")
    # The figure says which bytes it shows: where it is the same, so is the run.
    made_from = {"study": "tiny", "figure": "position", "file as_written": digest_of(folder / RUN)}
    figures.draw("position", data, "Position", plan.dpi, drawn, made_from)
    write_dataset(data["as_written"].assign_attrs(title="forged"), folder / RUN)
    # What `python -m snakemake` would find before the libraries.
    (folder / "yaml.py").write_text("raise SystemExit('of the archive')")
    path = packed(folder, tmp_path / "a.zip")
    assert main(["rebuild", str(path), "-o", str(tmp_path / "kept")]) == 1
    out = capsys.readouterr().out
    assert f"made again by the installed code, stiffdice {__version__}: 2 files are the same to the last bit" in out
    assert "1 differ; 0 hold or show times and are not compared\nDIFFERS, between" in out
    assert "the numbers are the same; different: attributes in 1 file\ntitle: forged against " in out


# Whether an archive's code is the installed code, file by file.


@pytest.fixture(scope="module")
def listed():
    """The digests that a manifest of this project's code has, and of a scene."""
    files = [file for top in ("src", "workflow") for file in contents.tree(ROOT, top, "code")]
    named = {file.path: file.source for file in files} | {"Makefile": ROOT / "Makefile"}
    return {name: manifest.digest_of(path) for name, path in named.items()} | {"config/scenes/mine.yaml": "0" * 64}


def test_this_projects_code_is_the_installed_code(listed):
    code = rebuilding.compared_code(ROOT, listed)
    assert code.is_installed and code.version == __version__ and code.files == len(listed) - 2


@pytest.mark.parametrize(
    ("name", "digest"),
    [
        ("src/stiffdice/dynamics/contact.py", "0" * 64),
        ("src/stiffdice/io/more.py", "0" * 64),
        ("src/numpy/__init__.py", "0" * 64),
        ("workflow/run.py", "0" * 64),
        ("workflow/profiles/default/config.yaml", None),
        ("workflow/Snakefile", "0" * 64),
    ],
)
def test_one_file_makes_it_other_code(listed, name, digest):
    """Changed, added or missing."""
    changed = {key: value for key, value in {**listed, name: digest}.items() if value}
    code = rebuilding.compared_code(ROOT, changed)
    assert not code.is_installed and code.other == (name,)
    assert f"installed is {__version__}: 1 of {code.files} files differ: {name}" in str(code)


def test_some_of_many_are_named(listed):
    code = rebuilding.compared_code(ROOT, dict.fromkeys(listed, "0" * 64))
    assert str(code).endswith(f" and {len(code.other) - rebuilding.SHOWN} more")


def test_a_package_that_is_no_checkout_has_no_workflow_to_run(listed, tmp_path, monkeypatch):
    """As a wheel installs it: its library is compared, and the difference says what is missing."""
    package = tmp_path / "site-packages" / PACKAGE.name
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(rebuilding, "PACKAGE", package)
    code = rebuilding.compared_code(ROOT, listed)
    assert {Path(name).parts[0] for name in code.other} == {"workflow"}
    assert "a package has no workflow/, a checkout has" in str(code)
