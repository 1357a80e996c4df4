"""In which folder compiled kernels are kept on disk, and what is to be done where one is not there.

Numba looks only at the file of a cached function, not at those it imports: edit a contact law, and a cached kernel
would keep the old physics. So the folder of the cache carries a digest of all sources of the simulation, and the
versions that compile them.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from functools import cache
from importlib.metadata import version
from pathlib import Path

from stiffdice.dynamics.code_digest import code_digest
from stiffdice.errors import OutputError

LOADING: ContextVar[bool] = ContextVar("LOADING", default=False)
TELLING: ContextVar[Callable[[], None] | None] = ContextVar("TELLING", default=None)


@cache
def cache_folder() -> Path:
    """Return the folder of compiled kernels, made if it was not there; raises OutputError where none can be."""
    parts = [code_digest("stiffdice.simulation.run"), version("numba"), version("numpy"), version("llvmlite")]
    name = "kernels-" + hashlib.sha256(" ".join(parts).encode()).hexdigest()[:16]
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        home = Path(base) if base else Path("~/.cache").expanduser()
    except RuntimeError:  # a user without a home
        home = Path("/tmp")
    if home.name.startswith("kernels-") and home.parent.name == "stiffdice":
        home = home.parent.parent  # a parent process set it to its own folder
    for place in (home, None):
        with contextlib.suppress(OSError):
            folder = (place / "stiffdice" if place else Path(tempfile.gettempdir(), f"stiffdice-{os.getuid()}")) / name
            if _is_made(folder.parent) and _is_made(folder):
                with tempfile.TemporaryFile(dir=folder) as file:
                    file.write(bytes(4096))  # on a full disk numba would fail, at the end of compiling
                return folder
    try:
        return Path(tempfile.mkdtemp(prefix="stiffdice-"))
    except OSError as error:
        raise OutputError(
            f"compiled kernels: neither {home} nor a folder for temporary files can be written ({error.strerror}); "
            "name one that can be in NUMBA_CACHE_DIR"
        ) from None


def _is_made(folder: Path) -> bool:
    """Make a folder if it is not there; return whether it is one, no link to one, ours, and not for all to write."""
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    found = folder.lstat()
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & stat.S_IWOTH


class NotStoredError(Exception):
    """A kernel is not on disk, and is not to be compiled now."""


@contextlib.contextmanager
def only_stored() -> Iterator[None]:
    """Raise NotStoredError where the block would have to compile a kernel."""
    token = LOADING.set(True)
    try:
        yield
    finally:
        LOADING.reset(token)


@contextlib.contextmanager
def telling(compiles: Callable[[], None]) -> Iterator[None]:
    """Call a function before a kernel is compiled in the block."""
    token = TELLING.set(compiles)
    try:
        yield
    finally:
        TELLING.reset(token)
