"""How far a computation is: its loops say it, one within another, and whoever runs it may listen."""

from __future__ import annotations

import contextlib
import itertools
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
    hears, ends = _HEARS.get(), [*itertools.accumulate(work or [1.0] * len(items))]
    for item, end, share in zip(items, ends, work or [1.0] * len(items), strict=True):
        if hears is None:
            yield item
            continue
        with told_to(_within(hears, (end - share) / ends[-1], share / ends[-1])):
            yield item
        hears(end / ends[-1])


def _within(hears: Callable[[float], None], begin: float, share: float) -> Callable[[float], None]:
    return lambda part: hears(begin + share * part)
