"""Files from elsewhere, tried in another process before this one touches them.

A renewed seal makes any damage look sound, and the HDF5 library may crash, hang or fill the memory on a file that was
made to. So a child opens it first, with all checks, reads every value, and answers; a file that ends the child is
refused. The pipeline reads its own results without it. Run as `python -P -m MODULE`, the child reads a list of paths as
JSON, and answers each with a line of JSON: what is wrong, or null. MODULE is this one for files of ours; another for
files of another form, whose reader it serves.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from stiffdice.errors import InputError, RefusedError

SECONDS = 60  # of processor time that a file may take
PATIENCE = 5  # times as long on the clock, of a machine with other things to do
MEMORY = 1 << 30  # bytes the child may have

OURS = "stiffdice.io.isolation"  # which is `__main__` in the child

_KINDS = {kind.__name__: kind for kind in (InputError, RefusedError)}


def refused(paths: Iterable[str | Path], module: str = OURS) -> dict[str, InputError]:
    """Return what is wrong with each file that cannot be trusted, by its path; nothing for those that are sound.

    module: what the child runs. One child for all of them; another goes on where a file ends it. Every error names its
    file. Raises InputError if no child can be started.
    """
    wrong, due = dict[str, InputError](), [str(path) for path in paths]
    while due:
        answers, _ = tried(due, module)
        wrong |= {path: _KINDS[found[0]](found[1]) for path, found in zip(due, answers, strict=False) if found}
        for path in due[len(answers) : len(answers) + 1]:
            wrong[path] = RefusedError(f"{path}: the HDF5 library fails on it: it crashes, or takes over {SECONDS} s")
        due = due[len(answers) + 1 :]
    return wrong


def admit(*paths: str | Path, module: str = OURS) -> None:
    """Raise InputError, naming the file, at the first of these files from elsewhere that cannot be trusted.

    module: what the child runs.
    """
    for error in refused(paths, module).values():
        raise error


def tried(paths: Sequence[str], module: str = OURS) -> tuple[list[list[str] | None], int]:
    """Return a child's answers on some files, up to the one that ended it, and its exit status."""
    # -P: what lies about in the folder of the files is not imported.
    command = [sys.executable, "-P", "-m", module]
    # The child runs the same code, wherever this is; and BLAS, which is not needed, reserves no memory for threads.
    ours = os.pathsep.join([str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = os.environ | {"PYTHONPATH": ours, "OPENBLAS_NUM_THREADS": "1"}
    pipe, asked = subprocess.PIPE, json.dumps(paths).encode()
    try:
        child = subprocess.run(
            command, input=asked, stdout=pipe, stderr=subprocess.DEVNULL, env=environment, check=False
        )
    except OSError as error:
        raise InputError(f"cannot start a process to try files in: {error.strerror}") from None
    ready, *answers = child.stdout.split(b"\n")[:-1] or [b""]
    if ready != b"ready":
        raise InputError("cannot start a process to try files in: it ended at once")
    return [json.loads(answer) for answer in answers], child.returncode


def _limit(seconds: int) -> None:
    """Let this process have so many more seconds of processor time, and no more than its share of memory."""
    signal.alarm(seconds * PATIENCE)
    used = resource.getrusage(resource.RUSAGE_SELF)
    end = int(used.ru_utime + used.ru_stime) + 1 + seconds
    for kind, most in ((resource.RLIMIT_CPU, end), (resource.RLIMIT_AS, MEMORY), (resource.RLIMIT_CORE, 0)):
        with contextlib.suppress(OSError, ValueError):
            hard = resource.getrlimit(kind)[1]
            resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def serve(read: Callable[[str], object]) -> None:
    """Answer for each file with what is wrong, once it was read whole; read: raises InputError, naming the file."""
    print("ready", flush=True)
    for path in json.load(sys.stdin):
        _limit(SECONDS)
        answer = None
        try:
            read(path)
        except InputError as error:
            answer = [type(error).__name__, str(error)]
        print(json.dumps(answer), flush=True)


def _reader() -> Callable[[str], None]:
    """Return what reads every value of a file of ours, a piece at a time."""
    import numpy as np  # and all else that takes time to import: who starts this process needs none of it

    from stiffdice.io.structure_check import check_values, opened, told

    def read(path: str) -> None:
        with told(path), opened(path) as (file, contents):
            for name, variable in contents.variables.items():
                stored = file[name]
                places = [()] if stored.chunks is None else stored.iter_chunks() if stored.size else []
                for place in places:
                    check_values(name, variable, np.asarray(stored[place]))

    return read


if __name__ == "__main__":
    serve(_reader())
