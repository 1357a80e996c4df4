"""A command that nobody vouches for, run where it reaches nothing but one folder, and ended with all that it started.

A sandbox is bubblewrap's (https://github.com/containers/bubblewrap): namespaces of its own for users, files, processes,
network, names and messages, no capabilities, and of the files only the system's programs, Python and the folder.
Without it, util-linux's `unshare` takes away the network and gives processes that end together, nothing else.
"""

from __future__ import annotations

import itertools
import os
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import IO, NamedTuple

import psutil

from stiffdice.errors import RefusedError

_INSIDE = Path("/rebuilt")  # where a sandbox has the folder
_HOME, _TEMPORARY = ".home", ".home/tmp"  # in it

# Of /etc, what programs read before they do anything: where libraries are, which of two is the default, fonts.
_OF_ETC = ("ld.so.cache", "alternatives", "fonts", "octaverc", "octave.conf", "localtime")

_PATIENCE = 5.0  # seconds for what was killed to be gone


class Way(NamedTuple):
    """How a command is run: what is put before it, the folder as it sees that, and what it can do besides.

    could: nothing in a sandbox.
    """

    prefix: tuple[str, ...]
    folder: Path
    could: tuple[str, ...] = ()

    def __str__(self) -> str:
        if not self.could:
            return "in a sandbox: no network, no files but its own and this Python, nothing that goes on afterwards"
        return f"without a sandbox: it can {', '.join(self.could)}"


def sandboxed(folder: Path) -> Way:
    """Return how to run a command in a sandbox that has a folder; raises RefusedError, with why, if there is none."""
    program = shutil.which("bwrap")
    if program is None:
        raise RefusedError("there is no sandbox: bubblewrap (bwrap) is not installed")
    (temporary := folder.resolve() / _TEMPORARY).mkdir(parents=True, exist_ok=True)
    # Root, with its capabilities, could make writable again what it may only read.
    prefix = [program, "--unshare-all", "--cap-drop", "ALL", "--die-with-parent", "--new-session"]
    prefix += ["--proc", "/proc", "--dev", "/dev", "--bind", str(temporary), "/tmp", *_readable(folder)]
    prefix += ["--bind", str(folder.resolve()), str(_INSIDE), "--chdir", str(_INSIDE), "--"]
    way = Way(tuple(prefix), _INSIDE)
    found = "import sys, importlib.util as u; sys.exit(not all(map(u.find_spec, ('snakemake', 'numba', 'h5py'))))"
    tried = subprocess.run(
        [*prefix, sys.executable, "-c", found], env=environment(way), capture_output=True, text=True, check=False
    )
    if tried.returncode != 0:
        reason = (tried.stderr.strip().splitlines() or ["this Python's packages are not found in it"])[-1]
        raise RefusedError(f"there is no sandbox: bubblewrap does not work here ({reason})")
    return way


def _readable(folder: Path) -> list[str]:
    """Return options of bubblewrap for what can be read: programs and libraries of the system, and this Python."""
    options = []
    for top in (Path("/", name) for name in ("bin", "sbin", "lib", "lib32", "lib64")):
        if top.is_symlink():
            options += ["--symlink", str(top.readlink()), str(top)]
        elif top.is_dir():
            options += ["--ro-bind", str(top), str(top)]
    for name in _OF_ETC:
        options += ["--ro-bind-try", f"/etc/{name}", f"/etc/{name}"]
    # What would show the home, or what lies beside the folder, is left out, and Python does not start without it.
    # An environment may be a link, and stand on a Python elsewhere, which may be named through a link, too.
    python = (Path(sys.prefix), Path(sys.base_prefix), Path(sys.executable).resolve().parents[1])
    home = Path(os.path.expanduser("~"))  # noqa: PTH111 (which may raise)
    hidden = {home.resolve(), *home.resolve().parents, *folder.resolve().parents}
    for place in (Path("/usr"), *python):
        if place.resolve() not in hidden:
            options += ["--ro-bind", str(place), str(place), "--ro-bind", str(place.resolve()), str(place.resolve())]
    return options


def unconfined(folder: Path) -> Way:
    """Return how to run a command that can do what this user can; without a network, as far as the system allows."""
    could, leave = ("read, change and remove whatever you can",), "leave processes behind"
    together = ("--net", "--pid", "--fork", "--kill-child", "--mount-proc")
    users = ((), ("--map-current-user",), ("--map-root-user",))
    for spaces, user in itertools.product((together, ("--net",)), users):
        prefix = ("setpriv", "--pdeathsig", "KILL", "unshare", *user, *spaces)
        with suppress(OSError):
            if subprocess.run([*prefix, "true"], capture_output=True, check=False).returncode == 0:
                return Way(prefix, folder.resolve(), could if spaces == together else (*could, leave))
    return Way((), folder.resolve(), (*could, leave, "use the network"))


def environment(way: Way) -> dict[str, str]:
    """Return the environment variables of a command: a home in the folder, none of who runs it.

    Outside of a sandbox Python may need to be told where its libraries are.
    """
    kept = {name: os.environ[name] for name in ("LD_LIBRARY_PATH",) if way.could and name in os.environ}
    return kept | {
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.defpath]),
        "HOME": str(way.folder / _HOME),
        "USER": "nobody",  # where no file says the user's name
        "TMPDIR": str(way.folder / _TEMPORARY),
        "LANG": "C.UTF-8",
        "PYTHONPATH": str(way.folder / "src"),
        "PYTHONNOUSERSITE": "1",
    }


def start(way: Way, command: list[str], folder: Path, out: IO[bytes]) -> subprocess.Popen[bytes]:
    """Start a command in a folder; out: where all goes that it says."""
    (folder / _TEMPORARY).mkdir(parents=True, exist_ok=True)
    return subprocess.Popen(
        [*way.prefix, *command],
        cwd=folder,
        env=environment(way),
        stdin=subprocess.DEVNULL,
        stdout=out,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )


def end(running: subprocess.Popen[bytes]) -> None:
    """Kill a command, and return when it is gone with all that it started.

    Its first child is the first process of the namespace, whose end the kernel reports when all others in it are gone.
    """
    with suppress(psutil.NoSuchProcess, subprocess.TimeoutExpired):
        for child in psutil.Process(running.pid).children():
            child.kill()
        running.wait(_PATIENCE)
    running.kill()
    running.wait()
