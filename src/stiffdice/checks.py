"""Checks of single values; each returns the value in its final type or says what is allowed."""

from __future__ import annotations

import difflib
import math
import numbers
from collections.abc import Collection, Mapping
from typing import Any

from stiffdice.errors import InputError

Vector = tuple[float, float, float]

# Above 2^53 neighbouring whole numbers share one double.
LARGEST_COUNT = 2**53


def shown(value: object) -> str:
    """Return a value as a person typed it, cut to a readable length."""
    text = "nothing" if value is None else repr(value) if value == "" else str(value)
    return text if len(text) <= 60 else text[:57] + "..."


def number(key: str, value: object, unit: str, *, above: float | None = None, at_least: float | None = None) -> float:
    """Return `value` as a finite float within its bounds.

    Raises InputError for anything else: booleans, text, NaN and infinities included.
    """
    allowed = "a finite number"
    if above is not None:
        allowed += f" > {above:g}"
    if at_least is not None:
        allowed += f" >= {at_least:g}"
    if unit:
        allowed += f" [{unit}]"
    try:
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise ValueError
        result = float(value)
    except (ValueError, OverflowError):
        told = f"the text '{shown(value)}'" if isinstance(value, str) else shown(value)
        raise InputError(f"{key} = {told}: allowed is {allowed}") from None
    if not math.isfinite(result):
        raise InputError(f"{key} = {shown(value)}: allowed is {allowed}")
    if (above is not None and result <= above) or (at_least is not None and result < at_least):
        raise InputError(f"{key} = {shown(value)}: allowed is {allowed}")
    return result + 0.0  # -0 is 0: equal scenes have equal digests


def count(key: str, value: object, *, at_least: int = 1, at_most: int = LARGEST_COUNT) -> int:
    """Return `value` as a whole number in [at_least, at_most]; 1e4 and 1.0e4 count as whole.

    Raises InputError otherwise.
    """
    whole = isinstance(value, numbers.Integral) or (isinstance(value, float) and value.is_integer())
    if isinstance(value, bool) or not whole or not at_least <= value <= at_most:  # type: ignore[operator]
        raise InputError(f"{key} = {shown(value)}: allowed is a whole number from {at_least} to {at_most}")
    return int(value)  # type: ignore[call-overload]


def vector(key: str, value: object, unit: str) -> Vector:
    """Return `value` as three finite floats; raises InputError otherwise."""
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise InputError(f"{key} = {shown(value)}: allowed are three finite numbers, as [x, y, z] [{unit}]")
    x, y, z = (number(f"{key}[{axis}]", part, unit) for axis, part in zip("xyz", value, strict=True))
    return x, y, z


def choice(key: str, value: object, allowed: Collection[str]) -> str:
    """Return `value` if it is one of `allowed`; raises InputError otherwise."""
    if not isinstance(value, str) or value not in allowed:
        raise InputError(f"{key} = {shown(value)}: allowed is {' or '.join(allowed)}")
    return value


def known_keys(where: str, mapping: object, allowed: Collection[str]) -> Mapping[str, Any]:
    """Return `mapping` if it is one and has no key outside `allowed`; raises InputError otherwise."""
    if not isinstance(mapping, Mapping):
        raise InputError(f"{where or 'the file'} = {shown(mapping)}: allowed are keys: {', '.join(allowed)}")
    for key in mapping:
        if key not in allowed:
            full = f"{where}.{shown(key)}" if where else shown(key)
            close = difflib.get_close_matches(str(key), allowed, n=1)
            meant = f"; did you mean {close[0]}?" if close else ""
            raise InputError(f"{full}: unknown key; allowed are {', '.join(allowed)}{meant}")
    return mapping
