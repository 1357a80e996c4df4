"""Several kernels compiled at once, in as many processes: most of compiling is numba's own work in Python."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from typing import Any

from stiffdice.dynamics.compiling.kernel_cache import LOADING, TELLING, NotStoredError, only_stored
from stiffdice.io.process import forked

_Due = Sequence[tuple[Any, tuple[Any, ...]]]  # kernels, each with the types of its arguments


STORING: ContextVar[bool] = ContextVar("STORING", default=False)


def begin(compiles: Callable[[], None]) -> int:
    """Return the number of another process that compiles a kernel and stores it; 0 where none can be forked."""
    return forked(lambda: _alone(compiles), "python") if _can_fork() else 0


def compile_together(calls: _Due) -> None:
    """Load or compile kernels for these arguments, the heaviest first.

    Another process takes a part where that can be forked; what is compiled there is read from the cache on disk.
    """
    due = [(kernel, signature) for kernel, given in calls if (signature := _not_stored(kernel, given)) is not None]
    with _another(due) if len(due) > 1 and _can_fork() else contextlib.nullcontext():
        _compile_the_free(due)
        for kernel, signature in due:
            kernel.compile(signature)  # waits for those that the other has begun


def _not_stored(kernel: Any, arguments: tuple[Any, ...]) -> tuple[Any, ...] | None:
    """Load a kernel, or return the types that it is to be compiled for."""
    signature = tuple(map(kernel.typeof_pyval, arguments))
    try:
        with only_stored():
            kernel.compile(signature)
    except NotStoredError:
        if LOADING.get():
            raise
        return signature
    return None


def _compile_the_free(due: _Due) -> None:
    """Compile, one after another, what no other process has begun."""
    for kernel, signature in due:
        kernel.compile_unless_begun(signature)


def _can_fork() -> bool:
    """Return whether there is a core for another process, and no thread that might hold a lock when it is forked."""
    return sys.platform == "linux" and len(os.sched_getaffinity(0)) > 1 and threading.active_count() == 1


@contextlib.contextmanager
def _another(due: _Due) -> Iterator[None]:
    """Let a forked process compile, too, while the block lasts."""
    child = forked(lambda: _alone(lambda: _compile_the_free(due)), "python")
    try:
        yield
    except BaseException:
        os.kill(child, signal.SIGKILL)
        raise
    finally:
        os.waitpid(child, 0)


def _alone(compiles: Callable[[], None]) -> None:
    """Compile for others, and say nothing; what goes wrong goes wrong in the parent, too, which tells."""
    TELLING.set(None)
    STORING.set(True)
    compiles()
