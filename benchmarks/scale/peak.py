"""Run a command; tell its times and its peak memory: `python peak.py WORDS...`. It stands alone, and stays small.

What the kernel calls the peak of a process is at least what its parent held when it was started, so that a parent with
NumPy in it cannot ask.
"""

from __future__ import annotations

import os
import sys
import time


def main(words: list[str]) -> int:
    """Run a command and write as the last line of standard output what it took.

    That is wall time and processor time [s], and memory of the largest of its processes [B]. Returns its exit status,
    or 128 and the number of the signal that ended it.
    """
    begun = time.perf_counter()
    process = os.posix_spawnp(words[0], words, os.environ)
    _, status, usage = os.wait4(process, 0)
    seconds = time.perf_counter() - begun
    unit = 1 if sys.platform == "darwin" else 1024
    print(f"{seconds:.3f} {usage.ru_utime + usage.ru_stime:.3f} {usage.ru_maxrss * unit}", flush=True)
    code = os.waitstatus_to_exitcode(status)
    return code if code >= 0 else 128 - code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
