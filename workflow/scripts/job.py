"""What every script does around its one call: a log, the time it took, and errors as one line.

A script that Snakemake starts hands its job over to the warm process (`workflow/warm.py`), which has imported all that
jobs need, and waits for it. Without such a process, as on a cluster, it does the job itself.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
import pickle
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple, NoReturn

# The library of this checkout, installed or not: the one whose digest the workflow computed.
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "src"))

# Where the warm process listens.
ADDRESS = "STIFFDICE_WARM"

Say = Callable[[str], None]


class Sealed:
    """What the study's file says of a job: bytes in the job, which it opens where it is done (`Job.plan`)."""

    def __init__(self, planned: object) -> None:
        self.planned = planned

    def __reduce__(self) -> tuple[type[bytes], tuple[bytes]]:
        return bytes, (pickle.dumps(self.planned),)

    def __str__(self) -> str:
        return str(self.planned)


class Job(NamedTuple):
    """A job as plain data.

    script: the file whose `make` does it. rule, wildcards, input, output, log: Snakemake's; input by name. asked: what
    its result follows from, for the log. planned: what the study's file says of it, pickled, as unpickling imports
    what takes long. dpi: of a figure.
    """

    script: str
    rule: str
    wildcards: dict[str, str]
    input: dict[str, Any]
    output: list[str]
    log: str
    asked: str
    planned: bytes
    dpi: int

    def plan(self) -> Any:
        """Return what the study's file says of this job."""
        return pickle.loads(self.planned) if self.planned else None


def begin(script: str, snakemake: Any) -> NoReturn:
    """Have a job done: by the warm process if there is one, else here. Ends this process with the job's status."""
    params = snakemake.params
    job = Job(
        script,
        snakemake.rule,
        dict(snakemake.wildcards.items()),
        {name: files if isinstance(files, str) else list(files) for name, files in snakemake.input.items()},
        list(snakemake.output),
        snakemake.log[0],
        params.asked,
        getattr(params, "planned", b""),
        getattr(params, "dpi", 0),
    )
    status = _hand_over(job)
    if status is None:
        from stiffdice.io.process import end_with_parent

        end_with_parent("snakemake")
        gc.set_threshold(50_000)  # what is imported stays
        carry_out(job)
    os._exit(status)


def _hand_over(job: Job) -> int | None:
    """Have the warm process do a job, and return its exit status; None if there is none that takes it."""
    # A job of Slurm's has its own memory and time, also on the machine that runs Snakemake.
    if ADDRESS not in os.environ or "SLURM_JOB_ID" in os.environ:
        return None
    server = socket.socket(socket.AF_UNIX)
    try:
        server.connect(os.environ[ADDRESS])
        content = pickle.dumps(tuple(job))
        socket.send_fds(server, [len(content).to_bytes(8)], [1, 2])
        server.sendall(content)
    except OSError:
        return None

    def forward(number: int, frame: FrameType | None) -> None:
        with contextlib.suppress(OSError):
            server.send(bytes([number]))

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, forward)
    status = server.recv(1)
    return status[0] if status else 128 + signal.SIGKILL


def carry_out(job: Job) -> NoReturn:
    """Do a job in this process, with its log, and end the process with its status.

    A StiffdiceError is one line, in the log and on standard error, and status 2; any other error has its traceback in
    the log, too, and status 1. A signal that asks to stop gives 128 and its number.
    """
    log = _Log(job)
    signal.signal(signal.SIGTERM, _stop)
    # HDF5's errors that h5py cannot raise arrive at this hook.
    sys.unraisablehook = lambda what: log.say(f"in passing: {what.exc_value}".splitlines()[0])
    try:
        _clear(job)
        script = Path(job.script)
        sys.path.insert(0, str(script.parent))
        importlib.import_module(script.stem).make(job, log.say)
    except BaseException as error:
        log.end(error)
    log.done(job)
    os._exit(0)  # HDF5 may crash on the way out, and lose the status


def _clear(job: Job) -> None:
    """Remove what an attempt that was killed left: Slurm sends a job once the one before it is over, on any node."""
    if "SLURM_JOB_ID" in os.environ:
        from stiffdice.io.writer import clear

        for output in job.output:
            clear(Path(output))


class _Log:
    """The log of a job, from its first words on."""

    def __init__(self, job: Job) -> None:
        from stiffdice.study import job_log

        self._words, self._path, self._begun = job_log, job.log, time.monotonic()
        try:
            self._file = os.open(job.log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        except OSError as error:
            print(f"stiffdice: {job.log}: {error.strerror}", file=sys.stderr, flush=True)
            os._exit(1)
        self.say(job_log.begun())
        self.say(job_log.asked(job.asked))

    def say(self, text: str) -> None:
        """Write a line at once; a full disk does not stop a job, as what it makes matters more than what it says."""
        with contextlib.suppress(OSError):
            os.write(self._file, f"{text}\n".encode())

    def done(self, job: Job) -> None:
        """Write the last lines of a job that ended well: what it made, and what memory and time it took."""
        import resource

        for output in map(Path, job.output):
            name = Path(*output.parts[2:] or output.parts[-1:]).as_posix()
            self.say(self._words.made(name, self._words.digest_of(output)))
        self.say(self._words.memory((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10) / 1e6))
        self.say(self._words.done(time.monotonic() - self._begun))

    def end(self, error: BaseException) -> NoReturn:
        """Write the last line of a job that did not end well, and end the process."""
        from stiffdice.errors import StiffdiceError

        if isinstance(error, KeyboardInterrupt):
            number = signal.Signals[str(error) or "SIGINT"]
            self._last(self._words.interrupted(number.name), aloud=number != signal.SIGINT)
            os._exit(128 + number)
        self._last(self._words.failed(error), aloud=True)
        if not isinstance(error, StiffdiceError):
            import traceback

            self.say("\n" + "".join(traceback.format_exception(error)).rstrip())
            os._exit(1)
        os._exit(2)

    def _last(self, words: str, aloud: bool) -> None:
        self.say(words)
        if aloud:
            print(f"stiffdice: {self._path}: {words}", file=sys.stderr, flush=True)


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    """Stop as Ctrl-C does, so that nothing half-written is left; asked again, stop at once."""
    signal.signal(number, signal.SIG_DFL)
    raise KeyboardInterrupt(signal.Signals(number).name)


def tenths(say: Say) -> Callable[[float], None]:
    """Return a callback for progress that says every tenth of the work."""
    from stiffdice.study import job_log

    told = 0

    def tell(done: float) -> None:
        nonlocal told
        if done * 10 >= told + 1:
            told = int(done * 10)
            say(job_log.tenth(done))

    return tell


class Stopwatch:
    """Adds up the seconds spent in its blocks."""

    def __init__(self) -> None:
        self.seconds = 0.0

    @contextmanager
    def running(self) -> Iterator[None]:
        """Count the time until the block ends."""
        begun = time.perf_counter()
        yield
        self.seconds += time.perf_counter() - begun
