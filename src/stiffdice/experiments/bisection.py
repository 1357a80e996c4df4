"""Where something ends to hold. No sweep may bisect: passing comes and goes with the steps."""

from __future__ import annotations

import math
from collections.abc import Callable


def arithmetic(low: float, high: float) -> float:
    """Return the number half way."""
    return (low + high) / 2


def geometric(low: float, high: float) -> float:
    """Return the number half way in the logarithm."""
    return math.sqrt(low) * math.sqrt(high)


def bisected(
    holds: Callable[[float], bool],
    low: float,
    high: float,
    *,
    relative: float = 0.0,
    middle_of: Callable[[float, float], float] = arithmetic,
) -> tuple[float, float]:
    """Return the last number at which `holds` is true and the first at which it is not, between low and high.

    holds: true at low, false at high, and changes once. relative: how far apart the two may be, over the larger; 0
    takes neighbouring doubles.
    """
    while high - low > relative * high and low < (middle := middle_of(low, high)) < high:
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high
