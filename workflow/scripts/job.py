"""What every script does around its one call: a log, the time it took, and errors as one line."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NoReturn

# The library of this checkout, installed or not: the one whose digest the workflow computed.
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "src"))

from stiffdice.errors import StiffdiceError
from stiffdice.io.writer import clear
from stiffdice.study import job_log, output_digest
from stiffdice.study.process import end_with_parent

end_with_parent("snakemake")


class _Log:
    """The log of this job, from its first words on; an error that nobody catches ends it, and the script.

    A StiffdiceError is one line, here and on standard error, and exit status 2; any other error has its traceback in
    the log, too, and exit status 1. A signal that asks to stop gives 128 and its number.
    """

    def __init__(self, path: str) -> None:
        self._path, self._begun = path, time.monotonic()
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        except OSError as error:
            sys.exit(f"stiffdice: {path}: {error.strerror}")
        self.say(job_log.begun())
        self.say(job_log.asked(sys.modules["__main__"].snakemake.params.asked))
        sys.excepthook = lambda kind, error, trace: self.end(error)
        signal.signal(signal.SIGTERM, _stop)

    def say(self, text: str) -> None:
        """Write a line at once; a full disk does not stop a job, as what it makes matters more than what it says."""
        with contextlib.suppress(OSError):
            os.write(self._file, f"{text}\n".encode())

    def done(self) -> None:
        """Write the last lines of a job that ended well: what it made, and how long it took."""
        for output in map(Path, sys.modules["__main__"].snakemake.output):
            self.say(job_log.made(Path(*output.parts[2:]).as_posix(), output_digest.digest_of(output)))
        self.say(job_log.done(time.monotonic() - self._begun))

    def end(self, error: BaseException) -> NoReturn:
        """Write the last line of one that did not, and end here: HDF5 may crash on the way out, and lose the status."""
        if isinstance(error, KeyboardInterrupt):
            number = signal.Signals[str(error) or "SIGINT"]
            self._last(job_log.interrupted(number.name), aloud=number != signal.SIGINT)
            os._exit(128 + number)
        self._last(job_log.failed(error), aloud=True)
        if not isinstance(error, StiffdiceError):
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


# Snakemake's script is at its imports, which take a second and may fail: its log begins here.
_log = _Log(sys.modules["__main__"].snakemake.log[0])

# Slurm sends a job once the one before it is over, and on any node: what that left is nobody's else to remove.
if "SLURM_JOB_ID" in os.environ:
    for _output in sys.modules["__main__"].snakemake.output:
        clear(Path(_output))


@contextmanager
def logged() -> Iterator[Callable[[str], None]]:
    """Write what the block says to the log, and how it ends; see `_Log` for what an error does."""
    # From here on every error arrives below, but for those that h5py cannot raise: it hands them to both hooks.
    sys.excepthook = lambda kind, error, trace: None
    sys.unraisablehook = lambda what: _log.say(f"in passing: {what.exc_value}".splitlines()[0])
    try:
        yield _log.say
    except BaseException as error:
        _log.end(error)
    _log.done()


def tenths(say: Callable[[str], None]) -> Callable[[float], None]:
    """Return a callback for progress that says every tenth of the work."""
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
