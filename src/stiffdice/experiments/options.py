"""Checks of options that many experiments have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from stiffdice.dynamics.state import Array
from stiffdice.errors import InputError
from stiffdice.scene import validation


def numbers(key: str, values: Sequence[float], unit: str, **bounds: Any) -> list[float]:
    """Return finite numbers; bounds: `above` or `at_least`. Raises InputError for one out of range."""
    return [validation.number(key, value, unit, **bounds) for value in values]


def counts(key: str, values: Sequence[float]) -> list[int]:
    """Return whole numbers from 1 on; raises InputError for any other."""
    return [validation.count(key, value) for value in values]


def stiffnesses(values: Sequence[float]) -> list[float]:
    """Return stiffnesses of the ground [kg/s²]; raises InputError for one out of range."""
    return numbers("stiffness", values, "kg/s²", above=0)


def span(values: Sequence[float], lowest: float = 0.0, below: float = math.inf) -> tuple[float, float]:
    """Return both ends of a span of ωh, `lowest` <= low < high < `below`, and 0 < low.

    Raises InputError for anything else.
    """
    ends = numbers("omega_h", values, "1")
    if len(ends) != 2 or not (0 < ends[0] < ends[1] < below and lowest <= ends[0]):
        bound = f"{lowest:g} <= " if lowest else "0 < "
        most = f" < {below:g}" if below < math.inf else ""
        shown = validation.shown(list(values))
        raise InputError(f"omega_h = {shown}: allowed are two numbers, {bound}low < high{most} [1]")
    return ends[0], ends[1]


def scan(low: float, high: float, count: int, special: Sequence[float]) -> Array:
    """Return values of ωh, ascending: `count` evenly in their logarithm, and those special ones that are between."""
    inside = [value for value in special if low <= value <= high]
    # The exact ends: geomspace's may differ in the last digit.
    return np.unique([low, *np.geomspace(low, high, count)[1:-1], high, *inside])
