"""Processes that do not outlive the one that started them, so that after a kill nothing of an earlier run goes on."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

_PR_SET_PDEATHSIG = 1  # of linux/prctl.h
_INIT = 1  # the process that inherits others


def end_with_parent(name: str) -> None:
    """Have the kernel kill this process when its parent is gone, however that ended; on Linux only.

    What goes on alone would still write: the results of an old plan over those of a new one, if that was changed since.
    name: in the parent's command line, by which it is told from the one that inherits orphans, should it be gone
    already.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        inherited = os.getppid() == _INIT
        if inherited and name not in Path(f"/proc/{_INIT}/cmdline").read_text(encoding="utf-8", errors="replace"):
            os.kill(os.getpid(), signal.SIGKILL)


def forked(work: Callable[[], object], name: str) -> int:
    """Return the number of a child that does some work, and ends with it, or with this process; nobody is told how.

    name: as of `end_with_parent`.
    """
    child = os.fork()
    if child == 0:
        try:
            end_with_parent(name)
            work()
        finally:
            os._exit(0)
    return child
