"""How far a long run is, and what a command is at, on standard error; what takes under two seconds says nothing."""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import cache
from typing import Self

from stiffdice.cli.terminal.output import QUIET

QUIET_SECONDS = 2.0
# s of one core of docs/explanation/speed.md; any other scheme takes about as long as the next.
_COMPILING = {"event": 12.0, "two cubes": 8.0}


class _Line:
    """A line that rewrites itself on a terminal; a line for each text elsewhere; nothing where all is to be quiet."""

    def __init__(self) -> None:
        self.is_terminal = sys.stderr is not None and sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
        self.is_quiet, self.is_shown = QUIET.get() or sys.stderr is None, False
        self.interval = 0.2 if self.is_terminal else 10.0  # s between two texts

    def say(self, text: str) -> None:
        if self.is_quiet:
            return
        self.is_shown = True
        if self.is_terminal:  # what is longer than the terminal is wide could not be taken back
            text = f"\r\x1b[K{text[: shutil.get_terminal_size().columns - 1]}"
        with contextlib.suppress(OSError):  # nobody reads it any more; the work goes on
            print(text, end="" if self.is_terminal else "\n", file=sys.stderr, flush=True)

    def clear(self) -> None:
        if self.is_shown and self.is_terminal:
            self.say("")


class _Left:
    """The time left of what has been done in part, from when its first part was done: compilation and all."""

    def __init__(self) -> None:
        self._first: tuple[float, float] | None = None

    def after(self, fraction: float) -> str:
        """Return how much is done and about how long the rest takes; empty as long as that is not known."""
        now = time.monotonic()
        self._first = self._first or (now, fraction)
        since, before = self._first
        if not before < fraction < 1:
            return ""
        left = (now - since) * (1 - fraction) / (fraction - before)
        return f"{fraction:6.1%} done, about {left:.0f} s left"


@contextlib.contextmanager
def progress(scheme: str = "") -> Iterator[Callable[[float], None]]:
    """Give a function that shows the fraction done: every ten seconds, on a terminal five times a second.

    Compiling is said once, and about how long it takes by the scheme, if there is one.
    """
    from stiffdice.dynamics.compiling.kernel_cache import telling

    line, left, next_time = _Line(), _Left(), time.monotonic() + QUIET_SECONDS

    def show(fraction: float) -> None:
        nonlocal next_time
        text = left.after(fraction)
        if text and time.monotonic() >= next_time:
            next_time = time.monotonic() + line.interval
            line.say(text)

    @cache
    def compiles() -> None:
        kernels = f"the kernels of {scheme}" if scheme else "kernels"
        line.say(f"compiling {kernels}, once; about {_COMPILING.get(scheme, 5.0):.0f} s")

    try:
        with telling(compiles):
            yield show
    finally:
        line.clear()


class Notes:
    """What a block is at; called with what it does next, and with the fraction that is done where that is known."""

    def __init__(self, what: str) -> None:
        self._what = self._text = what
        self._line, self._left, self._next_time = _Line(), _Left(), 0.0
        self._timer = threading.Timer(QUIET_SECONDS, lambda: self._line.say(f"{self._text} ..."))
        self._timer.daemon = True

    def __call__(self, doing: str, fraction: float | None = None) -> None:
        """Say what is done next, and about how long all takes from here on if a fraction of it is done."""
        self._text = f"{self._what} {doing}"
        left = "" if fraction is None else self._left.after(fraction)
        if self._line.is_shown:
            self._line.say(f"{self._text}: {left.strip()}" if left else self._text)

    def part(self, fraction: float) -> None:
        """Say how much is done, and about how long the rest takes."""
        left = self._left.after(fraction)
        if left and self._line.is_shown and time.monotonic() >= self._next_time:
            self._next_time = time.monotonic() + self._line.interval
            self._line.say(f"{self._text}: {left.strip()}")

    def compiles(self) -> None:
        """Say that kernels are compiled."""
        self._line.say(f"{self._text}: compiling kernels, once")

    def __enter__(self) -> Self:
        self._timer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()
        self._line.clear()


def notes(what: str) -> Notes:
    """Return what says what a block does, once two seconds are over."""
    return Notes(what)


@contextlib.contextmanager
def trials(what: str) -> Iterator[Notes]:
    """Give what says what a block simulates, that it compiles included."""
    from stiffdice.dynamics.compiling.kernel_cache import telling

    with Notes(what) as told, telling(cache(told.compiles)):
        yield told
