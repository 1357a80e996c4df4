"""How far a long run is, and what a command is at, on standard error; what takes under two seconds says nothing."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType

QUIET_SECONDS = 2.0


@contextmanager
def told_if_slow(what: str) -> Iterator[None]:
    """Say in a line on standard error what the block does, if it takes longer."""
    timer = threading.Timer(QUIET_SECONDS, lambda: print(f"stiffdice: {what} ...", file=sys.stderr, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


class Progress:
    """A line that rewrites itself on a terminal, or a line every ten seconds elsewhere."""

    def __init__(self) -> None:
        self._terminal = sys.stderr.isatty()
        self._interval = 0.2 if self._terminal else 10.0
        self._next = time.monotonic() + QUIET_SECONDS
        self._shown = False
        self._first: tuple[float, float] | None = None  # when the first part was done, compilation and all

    def __enter__(self) -> Progress:
        return self

    def show(self, fraction: float) -> None:
        """Tell the fraction done, if it is time to."""
        now = time.monotonic()
        if self._first is None:
            self._first = now, fraction
        since, before = self._first
        if now < self._next or fraction >= 1 or fraction <= before:
            return
        self._next = now + self._interval
        self._shown = True
        left = (now - since) * (1 - fraction) / (fraction - before)
        end = "\r" if self._terminal else "\n"
        print(f"{fraction:6.1%} done, about {left:.0f} s left  ", end=end, file=sys.stderr, flush=True)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._shown and self._terminal:
            print(" " * 40, end="\r", file=sys.stderr, flush=True)


class Notes:
    """What a command is at, on standard error; one of under two seconds says nothing."""

    def __init__(self, what: str) -> None:
        self._what, self._shown = what, False
        self._terminal = sys.stderr.isatty()
        self._line, self._timer = "", threading.Timer(QUIET_SECONDS, self._say)
        self._timer.daemon = True

    def __enter__(self) -> Notes:
        self._timer.start()
        return self

    def show(self, text: str) -> None:
        """Say what is done next, once two seconds are over."""
        self._line = f"{self._what} {text}"
        if self._shown:
            self._say()

    def _say(self) -> None:
        first = "" if self._shown else " (a first time compiles, which may take a minute)"
        self._shown = True
        start, end = ("\r\x1b[K", "") if self._terminal else ("", "\n")
        print(f"{start}{self._line}{first}", end=end, file=sys.stderr, flush=True)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._timer.cancel()
        if self._shown and self._terminal:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
