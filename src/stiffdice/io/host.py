"""Where a process runs, as far as numbers of processes mean anything there."""

from __future__ import annotations

import socket
from pathlib import Path

_INITIAL = 0xEFFFFFFC  # number of the system's own namespace of processes (linux/proc_ns.h)


def name() -> str:
    """Return this host's name; in a namespace of processes of its own, as in a container, `HOST-NUMBER` of that.

    Processes of another one have other numbers, and cannot be seen from here.
    """
    try:
        space = Path("/proc/self/ns/pid").stat().st_ino
    except OSError:  # no Linux
        space = _INITIAL
    return socket.gethostname() if space == _INITIAL else f"{socket.gethostname()}-{space}"
