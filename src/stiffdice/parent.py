"""A process that does not outlive the one that started it, so that after a kill nothing of an earlier run goes on."""

from __future__ import annotations

import ctypes
import signal
import sys

_PR_SET_PDEATHSIG = 1  # of linux/prctl.h


def end_with_parent() -> None:
    """Have the kernel kill this process when its parent is gone, however that ended; on Linux only.

    What goes on alone would still write: the results of an old plan over those of a new one, if that was changed since.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
