"""Set up .venv from the lock files unless it is what they say: set_up.py [--check].

`.venv` is a link to a folder of `.venvs/`. A new environment is built there, under the path that its scripts name, and
the link is exchanged once it is whole: an interrupted set-up leaves the old one working. --check: only say in a line
what is wrong, as for commands that read; exit status 2 if there is no environment to go on with.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import importlib.util
import json
import os
import platform
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from threading import Thread

ROOT = Path(__file__).resolve().parent.parent

sys.path[:0] = [str(ROOT / "src"), str(ROOT / "workflow")]

import install_extras  # noqa: E402
import lock  # noqa: E402
import room  # noqa: E402

MISSING = "is missing"
LOCKS = ("build.lock", "requirements.lock")
QUIET = {"PIP_DISABLE_PIP_VERSION_CHECK": "1", "PIP_NO_INPUT": "1", "PYTHON": sys.executable}


class SetUpError(Exception):
    """Why there is no new environment, in one line."""


def digest(root: Path) -> str:
    """Return a digest of all that an environment is made from; raises SetUpError if pyproject.toml cannot be read."""
    try:
        project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    except ValueError as error:
        raise SetUpError(f"pyproject.toml: {error}") from None
    parts = [(root / "requirements" / name).read_bytes() for name in LOCKS]
    parts.append(json.dumps([project.get("build-system"), project.get("project")]).encode())
    return hashlib.sha256(b"\0".join(parts)).hexdigest()


def lack(root: Path) -> str:
    """Return what is wrong with .venv, in a few words; empty if it is what the lock files say."""
    if not (root / ".venv/bin/python").exists():
        return MISSING
    try:
        made_from = (root / ".venv/.installed").read_text(encoding="ascii").strip()
    except OSError:
        made_from = ""
    return "" if made_from == digest(root) else "is not what the lock files and pyproject.toml now say"


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[int]:
    """Give a locked file once no other set-up runs; who inherits it keeps the lock."""
    with (folder / "lock").open("a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("stiffdice: another set-up is under way; waiting for its end", flush=True)
            fcntl.flock(file, fcntl.LOCK_EX)
        yield file.fileno()


def set_up(root: Path) -> None:
    """Make .venv what the lock files say; raises SetUpError or OSError, and leaves the old one, if it cannot."""
    if not lack(root):
        return
    folder = root / ".venvs"
    folder.mkdir(exist_ok=True)
    with alone(folder) as held:
        if not lack(root):
            return
        check_unused(root)
        print(f"stiffdice: setting up .venv with Python {platform.python_version()} (about a minute, once)", flush=True)
        numbers = [int(path.name) for path in folder.iterdir() if path.name.isdigit()]
        new = folder / str(max(numbers, default=0) + 1)
        try:
            build(root, new, held)
            check_unused(root)
            exchange(root, new)
        finally:
            clear(root)
    print("stiffdice: .venv is ready")


def check_unused(root: Path) -> None:
    """Raise SetUpError if a study is being made with .venv."""
    try:
        lock.check_idle(root)
    except lock.RunningError as error:
        if (reason := lack(root)) != MISSING:
            raise SetUpError(f".venv {reason}, but {error}; the same command sets it up after that") from None


def build(root: Path, new: Path, held: int) -> None:
    """Build an environment: what is locked, stiffdice itself, and the extras (engines, say) that the old one has.

    held: a file that all that is started inherits, so that what outlives this process keeps the lock.
    """
    pip = [*empty(new, held), "install", "--quiet", "--no-warn-script-location", "--no-compile"]
    first, second = (str(root / "requirements" / name) for name in LOCKS)
    python, old = str(new / "bin/python"), root / ".venv"
    steps = [
        [*pip, "--require-hashes", "--only-binary", ":all:", "-r", first],
        [*pip, "--require-hashes", "--no-build-isolation", "--use-pep517", "-r", second],
        [*pip, "--no-deps", "--no-build-isolation", "--no-index", "-e", str(root)],
    ]
    for step in steps:
        if status := call(step, held):
            raise SetUpError(f"pip ended with status {status}; .venv is as it was")
    installed = {path.name.partition("-")[0] for path in old.glob("lib/python*/site-packages/*.dist-info")}
    for locked in (root / f"requirements/{extra}.lock" for extra in install_extras.EXTRAS):
        if there := [name for name in install_extras.asked(locked) if name.replace("-", "_") in installed]:
            call([python, str(root / "requirements/install_extras.py"), str(locked), *there], held)
    print("stiffdice: compiling packages and, beside them, the kernels of `make paper` (about 20 s)", flush=True)
    kernels = [python, str(root / "workflow/compile_kernels.py"), "paper"]
    beside = Thread(target=call, args=(kernels, held), kwargs={"silent": True})
    beside.start()
    call([python, "-m", "compileall", "-q", "-j", "0", str(new)], held, silent=True)
    beside.join()
    (new / ".installed").write_text(digest(root) + "\n", encoding="ascii")


def call(command: list[str], held: int, *, silent: bool = False) -> int:
    """Run a command, which inherits the locked file, and return its exit status."""
    environment = os.environ | QUIET
    return subprocess.run(command, check=False, env=environment, pass_fds=[held], capture_output=silent).returncode


def empty(venv: Path, held: int) -> list[str]:
    """Make an environment with nothing in it, and return how its pip is called; raises SetUpError if it cannot."""
    python, inside = sys.executable, str(venv / "bin/python")
    own = [inside, "-m", "pip"]
    # Debian without python3-venv has no ensurepip: the system's pip fills the environment.
    ways: list[tuple[object, list[str], list[str]]] = [
        (importlib.util.find_spec("ensurepip"), [python, "-m", "venv"], own),
        (
            importlib.util.find_spec("pip"),
            [python, "-m", "venv", "--without-pip"],
            [python, "-m", "pip", "--python", inside],
        ),
        (shutil.which("virtualenv"), ["virtualenv", "--quiet", "--python", python], own),
        (shutil.which("uv"), ["uv", "venv", "--quiet", "--seed", "--python", python], own),
    ]
    for there, command, pip in ways:
        if there and call([*command, str(venv)], held, silent=True) == 0:
            return pip
        shutil.rmtree(venv, ignore_errors=True)
    raise SetUpError(
        f"{python} can make no virtual environment; on Debian or Ubuntu: sudo apt install python3-venv "
        "(or have uv or virtualenv)"
    )


def exchange(root: Path, new: Path) -> None:
    """Have .venv be the new environment from one moment to the next."""
    venv, link = root / ".venv", root / ".venvs/next"
    link.unlink(missing_ok=True)
    link.symlink_to(new.relative_to(root))
    if venv.is_dir() and not venv.is_symlink():  # as earlier versions made it
        venv.rename(root / f".venvs/before-{new.name}")
    link.replace(venv)


def clear(root: Path) -> None:
    """Remove all environments but .venv and those that a process of this machine still uses."""
    for folder in (root / ".venvs").iterdir():
        if folder.is_dir() and folder.resolve() != (root / ".venv").resolve() and not is_used(folder):
            shutil.rmtree(folder, ignore_errors=True)


def is_used(venv: Path) -> bool:
    """Return whether a process of this machine has a library of an environment in memory, as far as Linux tells."""
    place = f" {venv.resolve()}/".encode()
    for maps in Path("/proc").glob("[0-9]*/maps"):
        with contextlib.suppress(OSError):  # it has ended, or is another user's
            if place in maps.read_bytes():
                return True
    return False


def main(arguments: list[str]) -> int:
    """Set up, or check, and return the exit status."""
    try:
        room.check_place(ROOT)
        if arguments != ["--check"]:
            set_up(ROOT)
        elif reason := lack(ROOT):
            print(f"stiffdice: .venv {reason}; make install sets it up", file=sys.stderr)
            return 2 if reason == MISSING else 0
    except (SetUpError, room.RoomError, OSError) as error:
        print(f"stiffdice: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nstiffdice: interrupted; .venv is as it was", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
