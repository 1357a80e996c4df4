"""Snakemake as a person follows it: one moving line on a terminal, now and then a line elsewhere.

What else Snakemake says is in its own log, in `.snakemake/log/`. It comes out here only if the run fails before a job
has told why, as then it is all there is to read.
"""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

EVERY = "STIFFDICE_EVERY"  # names the seconds between two lines of what is left, where these replace each other

_OURS, _LEFT = ("stiffdice: ", "Nothing to be done"), " jobs done, "


class _Shown:
    """The lines that are for people, written as they come; the others are withheld."""

    def __init__(self) -> None:
        self.is_terminal, self.withheld, self._moving = sys.stderr.isatty(), list[str](), False

    def take(self, lines: Iterable[str]) -> None:
        for line in lines:
            if line.startswith(_OURS):
                self._write(line.rstrip("\n"), moving=self.is_terminal and _LEFT in line)
            else:
                self.withheld.append(line)

    def _write(self, text: str, *, moving: bool) -> None:
        print(("\r\x1b[K" if self._moving else "") + text, end="" if moving else "\n", file=sys.stderr, flush=True)
        self._moving = moving

    def clear(self) -> None:
        if self._moving:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
            self._moving = False


def follow(
    command: list[str], folder: Path, environment: Mapping[str, str], tied: Callable[[], None]
) -> tuple[int, str]:
    """Run Snakemake and return its exit status, and what it said that was not shown.

    folder: to run it in. tied: called in the new process, to have it end with this one.
    """
    shown = _Shown()
    environment = {**environment, EVERY: "1"} if shown.is_terminal else environment
    pipe = {"stderr": subprocess.PIPE, "text": True, "errors": "replace"}
    process = subprocess.Popen(command, cwd=folder, env=environment, preexec_fn=tied, **pipe)  # noqa: PLW1509
    reader = threading.Thread(target=shown.take, args=[process.stderr], daemon=True)
    reader.start()
    try:
        process.wait()
    except BaseException:
        process.kill()
        raise
    finally:
        # Not for ever, and without closing the pipe: a job that outlives Snakemake has it, too, for a moment.
        reader.join(1.0)
        shown.clear()
    return process.returncode, "".join(shown.withheld)
