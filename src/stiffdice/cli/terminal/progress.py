"""How far a long run is, and what a command is at, on standard error; what takes under two seconds says nothing."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache

QUIET_SECONDS = 2.0
# s of one core of docs/explanation/speed.md; any other scheme takes about as long as the next.
_COMPILING = {"event": 12.0, "two cubes": 8.0}


class _Line:
    """A line that rewrites itself on a terminal; a line for each text elsewhere."""

    def __init__(self) -> None:
        self.is_terminal, self.is_shown = sys.stderr.isatty(), False

    def say(self, text: str) -> None:
        self.is_shown = True
        print(f"\r\x1b[K{text}" if self.is_terminal else f"{text}\n", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        if self.is_shown and self.is_terminal:
            self.say("")


@contextmanager
def progress(scheme: str = "") -> Iterator[Callable[[float], None]]:
    """Give a function that shows the fraction done: every ten seconds, on a terminal five times a second.

    Compiling is said once, and about how long it takes by the scheme, if there is one.
    """
    from stiffdice.dynamics.kernel_cache import telling

    line, next_time = _Line(), time.monotonic() + QUIET_SECONDS
    first: tuple[float, float] | None = None  # when the first part was done, compilation and all

    def show(fraction: float) -> None:
        nonlocal first, next_time
        now = time.monotonic()
        first = first or (now, fraction)
        since, before = first
        if now >= next_time and before < fraction < 1:
            next_time = now + (0.2 if line.is_terminal else 10.0)
            left = (now - since) * (1 - fraction) / (fraction - before)
            line.say(f"{fraction:6.1%} done, about {left:.0f} s left")

    @cache
    def compiles() -> None:
        kernels = f"the kernels of {scheme}" if scheme else "kernels"
        line.say(f"compiling {kernels}, once; about {_COMPILING.get(scheme, 5.0):.0f} s")

    try:
        with telling(compiles):
            yield show
    finally:
        line.clear()


@contextmanager
def notes(what: str) -> Iterator[Callable[[str], None]]:
    """Say what the block does, once two seconds are over; give a function that takes what it does next."""
    line, text = _Line(), what

    def show(doing: str) -> None:
        nonlocal text
        text = f"{what} {doing}"
        if line.is_shown:
            line.say(text)

    timer = threading.Timer(QUIET_SECONDS, lambda: line.say(f"{text} ..."))
    timer.daemon = True
    timer.start()
    try:
        yield show
    finally:
        timer.cancel()
        line.clear()
