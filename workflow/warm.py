"""A process that has imported what jobs need, and forks one child for each job: warm.py HANDLE STUDY...

A job then begins in milliseconds; a process of its own would import, and load compiled kernels, for a second or two.
HANDLE: of a listening socket. `run.py` starts it beside Snakemake, and `scripts/job.py` hands jobs over. Linux only.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
import pickle
import selectors
import signal
import socket
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "workflow" / "scripts"), str(ROOT / "src")]

import job  # noqa: E402

from stiffdice.errors import StiffdiceError  # noqa: E402
from stiffdice.io.process import end_with_parent, forked  # noqa: E402

_MODULES = (
    *("stiffdice.simulation.dataset", "stiffdice.simulation.energy_budget", "stiffdice.sweep.shard"),
    *("stiffdice.sweep.collect", "stiffdice.sweep.stability_limits", "stiffdice.report.figures.style"),
    *("stiffdice.report.figures.registry", "matplotlib.backends.backend_agg", "matplotlib.backends.backend_svg"),
    *("h5netcdf", "PIL.Image"),
)


class Warm:
    """Takes jobs from a listening socket, and does each in a child."""

    def __init__(self, listener: socket.socket) -> None:
        self._listener = listener
        self._events = selectors.DefaultSelector()
        self._events.register(self._listener, selectors.EVENT_READ, self._take)

    def serve(self, seconds: float | None = None) -> None:
        """Do what has come, or comes within some seconds, or without end."""
        for event, _ in self._events.select(seconds):
            event.data()

    def _take(self) -> None:
        client, _ = self._listener.accept()
        handles: list[int] = []
        try:
            head, handles, _, _ = socket.recv_fds(client, 8, 2)
            with client.makefile("rb") as stream:
                content = stream.read(int.from_bytes(head))
        except OSError:
            head = content = b""
        if not head or len(content) < int.from_bytes(head):  # its script is gone
            for opened in (client.detach(), *handles):
                os.close(opened)
            return
        process = os.fork()
        if not process:
            self._become(job.Job(*pickle.loads(content)), handles)
        for handle in handles:
            os.close(handle)
        ended = os.pidfd_open(process)
        self._events.register(ended, selectors.EVENT_READ, lambda: self._end(process, ended, client))
        self._events.register(client, selectors.EVENT_READ, lambda: self._forward(process, client))

    def _become(self, what: job.Job, handles: list[int]) -> NoReturn:
        """Do one job in this process, a child of the warm one."""
        end_with_parent("warm.py")
        signal.signal(signal.SIGINT, signal.default_int_handler)
        self._listener.close()
        for number, handle in enumerate(handles, start=1):
            os.dup2(handle, number)
        job.carry_out(what)

    def _forward(self, process: int, client: socket.socket) -> None:
        """Pass a signal on to a job; end the job if its script is gone."""
        if client.fileno() < 0:  # the job ended in the same moment
            return
        try:
            number = client.recv(1)
        except OSError:
            number = b""
        if not number:
            self._events.unregister(client)
        os.kill(process, number[0] if number else signal.SIGKILL)

    def _end(self, process: int, ended: int, client: socket.socket) -> None:
        _, status = os.waitpid(process, 0)
        code = os.waitstatus_to_exitcode(status)
        with contextlib.suppress(OSError):
            client.send(bytes([code if code >= 0 else 128 - code]))
        self._events.unregister(ended)
        with contextlib.suppress(KeyError):
            self._events.unregister(client)
        client.close()
        os.close(ended)


def load(names: list[str]) -> Iterator[None]:
    """Import what jobs need and load the kernels of some studies, little by little; have those not stored compiled."""
    for name in _MODULES:
        importlib.import_module(name)
        yield
    from stiffdice.study import config, warm_up

    missing = []
    for name in names:
        with contextlib.suppress(StiffdiceError):  # which Snakemake tells
            for run in warm_up.short_runs(config.load(f"config/{name}.yaml")):
                if not warm_up.load(run):
                    missing.append(run)
                yield
    if missing:  # jobs of one kind all wait for the same kernel; a core is free for those of the next
        forked(lambda: [warm_up.compile_kernels(run) for run in missing], "warm.py")


def main() -> NoReturn:
    """Load, and do jobs, until the process that started this one ends."""
    end_with_parent("run.py")
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warm = Warm(socket.socket(fileno=int(sys.argv[1])))
    for _ in load(sys.argv[2:]):
        warm.serve(0)
    gc.freeze()
    while True:
        warm.serve()


if __name__ == "__main__":
    main()
