"""How far a computation is: its loops say it, one within another, and whoever runs it may listen."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from typing import TypeVar

_Item = TypeVar("_Item")

_HEARS: ContextVar[Callable[[float], None] | None] = ContextVar("_HEARS", default=None)


@contextlib.contextmanager
def told_to(hears: Callable[[float], None]) -> Iterator[None]:
    """Call a function with the part that is done [1] of what the block does."""
    token = _HEARS.set(hears)
    try:
        yield
    finally:
        _HEARS.reset(token)


def tell(part: float) -> None:
    """Say what part is done [1] of what runs now: all of it, or an item of a loop by `each`."""
    if (hears := _HEARS.get()) is not None:
        hears(part)


def each(items: Sequence[_Item], work: Sequence[float] | None = None) -> Iterator[_Item]:
    """Yield items, and say how far the loop is; what is said while one is dealt with is of that one.

    work: how much work each is, in any unit; None takes all for the same.
    """
    hears, shares = _HEARS.get(), work or [1.0] * len(items)
    if hears is None:
        yield from items
        return
    whole, done = math.fsum(shares), 0.0
    for item, share in zip(items, shares, strict=True):
        with told_to(_within(hears, done / whole, share / whole)):
            yield item
        done += share
        hears(done / whole)


def _within(hears: Callable[[float], None], begin: float, share: float) -> Callable[[float], None]:
    return lambda part: hears(begin + share * part)
