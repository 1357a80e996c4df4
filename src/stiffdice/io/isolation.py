"""Files from elsewhere, tried in another process before this one touches them.

A renewed seal makes any damage look sound, and the HDF5 library may crash, hang or fill the memory on a file that was
made to. So a child opens it first, with all checks, reads every value, and answers; a file that ends the child is
refused. The pipeline reads its own results without it. Run as `python -P -m stiffdice.io.isolation`, the child reads
paths, each ended by a zero byte, and answers each with a line of JSON: what is wrong, or null.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path

import h5py
import numpy as np

from stiffdice.errors import InputError, RefusedError
from stiffdice.io.checked_file import check_values, opened, told

SECONDS = 60  # of processor time that a file may take
PATIENCE = 5  # times as long on the clock, of a machine with other things to do
MEMORY = 1 << 30  # bytes the child may have

_KINDS = {kind.__name__: kind for kind in (InputError, RefusedError)}


def refused(paths: Iterable[str | Path]) -> dict[str, InputError]:
    """Return what is wrong with each file that cannot be trusted, by its path; nothing for those that are sound.

    One child for all of them; it is started again where a file ends it. Every error names its file. Raises InputError
    if no child can be started.
    """
    wrong: dict[str, InputError] = {}
    with contextlib.ExitStack() as stack:
        child: Child | None = None
        for path in map(str, paths):
            child = child or stack.enter_context(Child())
            error = child.answer(path)
            if error is not None:
                wrong[path] = error
            if child.is_gone:
                child = None
    return wrong


def admit(*paths: str | Path) -> None:
    """Raise InputError, naming the file, at the first of these files from elsewhere that cannot be trusted."""
    for error in refused(paths).values():
        raise error


class Child:
    """A process that tries files, one after another."""

    def __enter__(self) -> Child:
        # -P: what lies about in the folder of the files is not imported.
        command = [sys.executable, "-P", "-m", "stiffdice.io.isolation"]
        pipe, nothing = subprocess.PIPE, subprocess.DEVNULL
        # The child runs the same code, wherever this is; and BLAS, which is not needed, reserves no memory for threads.
        ours = os.pathsep.join([str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = os.environ | {"PYTHONPATH": ours, "OPENBLAS_NUM_THREADS": "1"}
        try:
            self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=nothing, env=environment)
        except OSError as error:
            raise InputError(f"cannot start a process to try files in: {error.strerror}") from None
        if self._line() != b"ready\n":
            self.__exit__()
            raise InputError("cannot start a process to try files in: it ended at once")
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None and self._process.stdout is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        self._process.kill()
        self._process.wait()
        self._process.stdout.close()

    @property
    def is_gone(self) -> bool:
        """Whether a file has ended it."""
        return self._process.poll() is not None

    def answer(self, path: str) -> InputError | None:
        """Return what is wrong with a file, none if nothing is."""
        assert self._process.stdin is not None
        if "\0" in path:
            return InputError(f"{path!r}: no file has such a name")
        try:
            self._process.stdin.write(os.fsencode(path) + b"\0")
            self._process.stdin.flush()
            found = json.loads(self._line())
        except (OSError, ValueError):
            self._process.kill()
            self._process.wait()
            return RefusedError(f"{path}: the HDF5 library fails on it: it crashes, or takes over {SECONDS} s")
        return None if found is None else _KINDS[found[0]](found[1])

    def _line(self) -> bytes:
        assert self._process.stdout is not None
        watch = threading.Timer(SECONDS * PATIENCE, self._process.kill)
        watch.start()
        try:
            return self._process.stdout.readline()
        finally:
            watch.cancel()


def _read_all(path: str) -> None:
    """Read every value of a file, a piece at a time; raises InputError, naming the file, if it cannot be trusted."""
    with told(path), opened(path) as (file, contents):
        for name in contents.sizes:
            for piece in _pieces(file[name]):
                check_values(contents, name, piece)


def _pieces(dataset: h5py.Dataset) -> Iterator[np.ndarray]:
    if dataset.chunks is None:
        yield np.asarray(dataset[()])
    elif dataset.size:
        for place in dataset.iter_chunks():
            yield dataset[place]


def _limit(seconds: int) -> None:
    """Let this process have so many more seconds of processor time, and no more than its share of memory."""
    try:
        import resource
    except ImportError:  # not everywhere; the parent's patience ends, too
        return
    used = resource.getrusage(resource.RUSAGE_SELF)
    end = int(used.ru_utime + used.ru_stime) + 1 + seconds
    for kind, most in ((resource.RLIMIT_CPU, end), (resource.RLIMIT_AS, MEMORY), (resource.RLIMIT_CORE, 0)):
        with contextlib.suppress(OSError, ValueError):
            hard = resource.getrlimit(kind)[1]
            resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _serve() -> None:
    print("ready", flush=True)
    for path in _asked():
        _limit(SECONDS)
        answer = None
        try:
            _read_all(path)
        except InputError as error:
            answer = [type(error).__name__, str(error)]
        print(json.dumps(answer), flush=True)


def _asked() -> Iterator[str]:
    """Yield the paths that the parent asks for, one at a time."""
    left = b""
    while more := os.read(sys.stdin.fileno(), 1 << 16):
        *paths, left = (left + more).split(b"\0")
        yield from map(os.fsdecode, paths)


if __name__ == "__main__":
    _serve()
