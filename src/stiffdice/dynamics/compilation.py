"""What numba compiles, and in which folder that is kept on disk. Numba itself comes with `compiler.py`, when it does.

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
from functools import cache, cached_property, partial, update_wrapper
from importlib.metadata import version
from pathlib import Path
from typing import Any

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


class Compiled:
    """A function that numba compiles. Numba is imported once it is called, or taken into another that is.

    bodies: by the type of the first argument, of a function that calls one of them with the others. options: numba's.
    """

    def __init__(self, function: Callable[..., Any], bodies: dict[type, Any] | None, options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.py_func, self._bodies, self._options = function, bodies, options

    @cached_property
    def dispatcher(self) -> Any:
        """What numba has for the function."""
        from stiffdice.dynamics import compiler

        return compiler.dispatcher_of(self.py_func, self._bodies, self._options)

    @property
    def _numba_type_(self) -> Any:
        return self.dispatcher._numba_type_

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call it, compiled for these arguments if it was not."""
        return self.dispatcher(*arguments, **named)


class Intrinsic:
    """A function for compiled code only that writes LLVM's. module: returns its module, once compiled code calls it."""

    def __init__(self, module: Callable[[], Any], name: str) -> None:
        self._module, self._name = module, name

    @property
    def _numba_type_(self) -> Any:
        from stiffdice.dynamics import compiler

        return compiler.type_of(getattr(self._module(), self._name))


def njit(function: Any = None, **options: Any) -> Any:
    """Compile a function as numba's decorator does, with division by zero giving infinity or not-a-number.

    At the extremes a step, a stiffness or a weight may leave the range of doubles; that is a result, not an error.
    Arithmetic is as written unless `fastmath` is asked for here: left unsaid, numba takes it from whoever happens to
    call the function first. What is not kept in the cache on disk is a part of what is, and compiled as such.
    """
    if function is None:
        return partial(njit, **options)
    return Compiled(function, None, {"error_model": "numpy", "fastmath": False, "nopython": True} | options)


def constant(value: Any) -> Any:
    """Return a function, for compiled code only, that returns a value whatever its arguments."""
    return njit(lambda *arguments: value)


def by_tag(bodies: dict[type, Any], *, inlined: bool = False) -> Any:
    """Return a function, for compiled code only, that calls the body which the type of its first argument stands for.

    The first argument is a tag: an empty named tuple that stands for a model or a scheme. The body,
    which gets the arguments after it, is chosen at compile time, which costs nothing in a loop; unlike functions passed
    as arguments it leaves the kernel cacheable on disk, and unlike string literals it does not slow down every call of
    it (1 µs against 11 ms, numba 0.68). inlined: put what chooses into its caller, whatever its size.
    """

    def call(tag: Any, *arguments: Any) -> Any:
        raise TypeError("chosen by the type of the tag")

    options = {"error_model": "numpy", "fastmath": False, "nopython": True, "forceinline": inlined}
    return Compiled(call, bodies, options)
