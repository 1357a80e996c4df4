"""`.venv` is exchanged when it is due, and not before: with pip, and packages of a line that are made here."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest

from tests.workflow.test_at_once import wait_for

ROOT = Path(__file__).parent.parent
PYPROJECT = """
[build-system]
requires = []
build-backend = "backend"
backend-path = ["."]
[project]
name = "own"
version = "1.0"
"""
# Takes what the test has made for the package to be installed.
BACKEND = """
import shutil
def build_editable(folder, config_settings=None, metadata_directory=None):
    shutil.copy("own-1.0-py3-none-any.whl", folder)
    return "own-1.0-py3-none-any.whl"
"""


def wheel(folder: Path, name: str, version: str) -> str:
    """Make a package of one module that knows its version; return its line of a lock file."""
    about = f"{name}-{version}.dist-info"
    files = {
        f"{name}.py": f"version = {version!r}\n",
        f"{about}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n",
        f"{about}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    record = ""
    for path, text in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).rstrip(b"=").decode()
        record += f"{path},sha256={digest},{len(text)}\n"
    target = folder / f"{name}-{version}-py3-none-any.whl"
    with zipfile.ZipFile(target, "w") as file:
        for path, text in (files | {f"{about}/RECORD": f"{record}{about}/RECORD,,\n"}).items():
            file.writestr(path, text)
    return f"{name}=={version} \\\n    --hash=sha256:{hashlib.sha256(target.read_bytes()).hexdigest()}\n"


class Project:
    def __init__(self, folder: Path):
        self.folder, self.venv = folder, folder / ".venv"

    @classmethod
    def new(cls, folder: Path) -> Project:
        for name in ("requirements/install", "requirements/set_up.py", "requirements/install_extras.py"):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name)
        shutil.copytree(ROOT / "workflow", folder / "workflow", ignore=shutil.ignore_patterns("__pycache__"))
        (folder / "src").symlink_to(ROOT / "src")
        (folder / "wheels").mkdir()
        (folder / "pyproject.toml").write_text(PYPROJECT)
        (folder / "backend.py").write_text(BACKEND)
        wheel(folder, "own", "1.0")
        project = cls(folder)
        project.lock("build", wheel(folder / "wheels", "builder", "1.0"))
        project.lock("requirements", wheel(folder / "wheels", "tiny", "1.0"))
        project.lock("engines", wheel(folder / "wheels", "engine", "1.0") + wheel(folder / "wheels", "other", "1.0"))
        (folder / "requirements/engines.in").write_text("engine  # one\nother  # two\n")
        project.lock("docs", wheel(folder / "wheels", "page_maker", "1.0"))
        (folder / "requirements/docs.in").write_text("page-maker  # three\n")
        return project

    def lock(self, name: str, text: str) -> None:
        (self.folder / f"requirements/{name}.lock").write_text(text)

    def start(self, *words: str) -> subprocess.Popen[str]:
        quiet = {name: value for name, value in os.environ.items() if not name.startswith(("PIP_", "PYTHON"))}
        offline = {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(self.folder / "wheels"), "PIP_CONFIG_FILE": os.devnull}
        return subprocess.Popen(
            words or ["requirements/install"],
            cwd=self.folder,
            env=quiet | offline | {"PYTHON": sys.executable},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def call(self, *words: str) -> tuple[int, str, str]:
        started = self.start(*words)
        out, err = started.communicate()
        return started.returncode, out, err

    def version(self, package: str) -> str:
        return self.call(".venv/bin/python", "-c", f"import {package}; print({package}.version)")[1].strip()

    def environments(self) -> set[str]:
        return {path.name for path in (self.folder / ".venvs").iterdir() if path.is_dir() and not path.is_symlink()}


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A project that is set up, with one engine."""
    project = Project.new(tmp_path_factory.mktemp("project"))
    status, out, err = project.call("requirements/install", "--check")
    assert (status, out, err) == (2, "", "stiffdice: .venv is missing; make install sets it up\n")
    assert not project.venv.exists()
    status, out, err = project.call()
    assert status == 0, err
    assert out.endswith("stiffdice: .venv is ready\n")
    assert (project.venv.is_symlink(), project.version("tiny"), project.version("own")) == (True, "1.0", "1.0")
    extra = ("requirements/install_extras.py", "requirements/engines.lock", "engine")
    assert project.call(".venv/bin/python", *extra) == (0, "stiffdice: engine is ready\n", "")
    return project


@pytest.fixture
def due(project):
    """The project with another lock file than .venv was made from, and the version that it pins."""
    old = project.version("tiny")
    new = f"{int(float(old)) + 1}.0"
    project.lock("requirements", wheel(project.folder / "wheels", "tiny", new))
    return project, old, new


DUE = ".venv is not what the lock files and pyproject.toml now say"


@pytest.mark.long
def test_a_file_that_was_only_touched_is_nothing_new(project):
    leads = project.venv.readlink()
    later = time.time() + 3600
    os.utime(project.folder / "pyproject.toml", (later, later))
    assert project.call() == (0, "", "")
    assert project.call("requirements/install", "--check") == (0, "", "")
    assert project.venv.readlink() == leads


@pytest.mark.long
def test_who_reads_is_told_that_a_set_up_is_due_and_goes_on(due):
    project, old, _ = due
    assert project.call("requirements/install", "--check") == (0, "", f"stiffdice: {DUE}; make install sets it up\n")
    assert project.version("tiny") == old


HOLDING = """
import sys, time
from pathlib import Path
sys.path[:0] = ["src", "workflow"]
import lock
lock.hold(Path.cwd(), "many")
print(flush=True)
time.sleep(600)
"""


@pytest.mark.long
def test_a_study_that_is_being_made_keeps_its_environment(due):
    project, old, _ = due
    holder = project.start(".venv/bin/python", "-c", HOLDING)
    holder.stdout.readline()
    leads = project.venv.readlink()
    status, out, err = project.call()
    assert (status, out) == (2, "")
    told = f"stiffdice: {DUE}, but many is being made: by process {holder.pid} on "
    assert err.startswith(told)
    assert err.endswith("; the same command sets it up after that\n")
    assert err.count("\n") == 1
    assert (project.venv.readlink(), project.version("tiny")) == (leads, old)
    holder.kill()
    holder.communicate()


# As a process that has loaded a library.
USING = """
import mmap, time, tiny
from pathlib import Path
with open(Path(tiny.__file__).resolve(), "rb") as file:
    library = mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ)
print(flush=True)
time.sleep(600)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells what a process uses")
@pytest.mark.long
def test_engines_stay_and_so_does_what_is_used_until_the_next_set_up(due):
    """Which exchanges an environment of an earlier version of stiffdice, too, though one before it was killed."""
    project, old, new = due
    before = project.venv.readlink().name
    user = project.start(project.venv.resolve() / "bin/python", "-c", USING)
    user.stdout.readline()
    assert project.call()[0] == 0
    assert (project.version("tiny"), project.version("engine"), project.version("other")) == (new, "1.0", "")
    after = project.venv.readlink().name
    assert project.environments() == {before, after}
    user.kill()
    user.communicate()
    project.lock("requirements", wheel(project.folder / "wheels", "tiny", old))
    as_earlier_versions_left_it(project)
    interrupt(project, signal.SIGKILL)
    assert (project.version("tiny"), project.version("engine"), project.venv.is_symlink()) == (new, "1.0", False)
    assert project.call()[0] == 0
    assert (project.version("tiny"), project.version("engine"), project.venv.is_symlink()) == (old, "1.0", True)
    assert project.environments() == {project.venv.readlink().name}


def as_earlier_versions_left_it(project: Project) -> None:
    """Put a folder in the place of the link."""
    folder = project.venv.resolve()
    project.venv.unlink()
    folder.rename(project.venv)
    (project.venv / ".installed").write_text("")


@pytest.mark.long
def test_a_set_up_that_fails_leaves_the_old_environment(due):
    project, old, _ = due
    project.lock("requirements", f"tiny==9.0 \\\n    --hash=sha256:{'0' * 64}\n")
    status, _, err = project.call()
    assert status == 2
    assert err.endswith("stiffdice: pip ended with status 1; .venv is as it was\n")
    assert project.version("tiny") == old
    assert project.environments() == {project.venv.readlink().name}


@pytest.mark.broad
def test_an_interrupted_set_up_leaves_the_old_environment(due):
    project, old, new = due
    leads = project.venv.readlink()
    for way in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT):
        interrupt(project, way)
        assert (project.venv.readlink(), project.version("tiny"), project.version("engine")) == (leads, old, "1.0")
    assert project.call()[0] == 0
    assert (project.version("tiny"), project.version("engine")) == (new, "1.0")
    assert project.environments() == {project.venv.readlink().name}


def interrupt(project: Project, way: signal.Signals) -> None:
    """Start a set-up, and stop it once it has begun to build an environment."""
    before = len(project.environments())
    started = project.start()
    wait_for(lambda: len(project.environments()) > before)
    os.killpg(started.pid, way)
    assert started.communicate() and started.returncode != 0


@pytest.mark.broad
def test_of_two_set_ups_at_once_one_waits_for_what_the_other_started(due):
    """Pip goes on when its set-up is killed, and the next one lets it end."""
    project, _, new = due
    killed = project.start()
    wait_for(lambda: len(project.environments()) == 2)
    pip = wait_for(lambda: [*children(killed.pid)])
    os.kill(pip[0], signal.SIGSTOP)
    killed.kill()
    started = [project.start(), project.start()]
    for waiting in started:
        assert waiting.stdout.readline() == "stiffdice: another set-up is under way; waiting for its end\n"
    os.kill(pip[0], signal.SIGCONT)
    told = [process.communicate()[0] for process in started]
    with contextlib.suppress(ProcessLookupError):
        os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate()
    assert [process.returncode for process in started] == [0, 0]
    assert sorted("ready" in text for text in told) == [False, True]
    assert project.version("tiny") == new


def children(process: int) -> list[int]:
    return [int(word) for word in Path(f"/proc/{process}/task/{process}/children").read_text().split()]


@pytest.mark.parametrize(
    "sign", [" ", "'", *(pytest.param(sign, marks=pytest.mark.broad) for sign in '"$;{}\n\t`&(\\:*')]
)
@pytest.mark.long
def test_a_folder_that_snakemake_cannot_work_in_is_one_line_before_anything_is_done(tmp_path, sign):
    project = Project.new(tmp_path / f"my{sign}project")
    line = f"stiffdice: {str(project.folder)!r}: {sign!r} in a path is not for Snakemake; move the project\n"
    for words in (
        [],
        ["requirements/install", "--check"],
        [sys.executable, "workflow/run.py", "--cores", "2", "quick"],
    ):
        assert project.call(*words) == (2, "", line)
    assert not (project.folder / ".venvs").exists()
    assert not (project.folder / ".snakemake").exists()
