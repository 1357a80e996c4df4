"""What every script does around its one call: a log, the time it took, and errors as one line."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

# The library of this checkout, installed or not: the one whose digest the workflow computed.
sys.path.insert(0, str((Path(__file__).parents[2] / "src").resolve()))

from stiffdice.errors import StiffdiceError


@contextmanager
def logged(path: str) -> Iterator[Callable[[str], None]]:
    """Write what the block says, and how it ends, to the log; a StiffdiceError ends the script with its one line."""
    with Path(path).open("w", encoding="utf-8", buffering=1) as log:

        def say(text: str) -> None:
            log.write(text + "\n")

        try:
            yield say
        except KeyboardInterrupt:
            sys.exit(130)
        except StiffdiceError as error:
            say(f"failed: {error}")
            print(f"stiffdice: {error}", file=sys.stderr, flush=True)
            os._exit(2)  # HDF5 crashes on the way out after a file could not be written, and the status is lost


def tenths(say: Callable[[str], None]) -> Callable[[float], None]:
    """Return a callback for progress that says every tenth of the work."""
    told = 0

    def tell(done: float) -> None:
        nonlocal told
        if done * 10 >= told + 1:
            told = int(done * 10)
            say(f"{done:.0%} of the steps done")

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
