"""A process that reads spoilt files: python -m tests.fuzz.worker READER FIRST COUNT, and more such three.

Prints a case before it is tried, so that one that ends the process, or does not end, is known.
"""

from __future__ import annotations

import faulthandler
import resource
import signal
import sys
import tempfile
import traceback
from pathlib import Path

from tests.fuzz.readers import READERS

AT_ONCE = 20  # cases that are made before they are tried
SECONDS = 20  # of processor time, for one case
MEMORY = 6 << 30  # bytes of addresses; numba and its threads reserve the most of it


def main(name: str, first: int, count: int) -> int:
    """Return how many cases failed."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # The stack of a case that hangs is told, and then the signal ends the process.
    faulthandler.register(signal.SIGPROF, chain=True)
    failed = 0
    with tempfile.TemporaryDirectory() as place:
        samples, spoil, attempt, before = READERS[name](Path(place))
        for leftover in Path(place).iterdir():
            leftover.unlink()
        for seed in range(first, first + count):
            if (seed - first) % AT_ONCE == 0:
                ahead = range(seed, min(seed + AT_ONCE, first + count))
                spoilt = [spoil(samples[k % len(samples)], samples, k) for k in ahead]
                before(spoilt, Path(place))
            print(f"{name} {seed}", file=sys.stderr, flush=True)
            sample, data = samples[seed % len(samples)], spoilt[(seed - first) % AT_ONCE]
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            try:
                attempt(data, sample, Path(place))
            except Exception:
                failed += 1
                print(f"failed: {name} {seed}\n{traceback.format_exc()}", flush=True)
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0)
    return failed


if __name__ == "__main__":
    asked = zip(sys.argv[1::3], map(int, sys.argv[2::3]), map(int, sys.argv[3::3]), strict=True)
    sys.exit(sum(main(*each) for each in asked) > 0)
