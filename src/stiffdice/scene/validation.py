"""Checks of single values; each returns the value in its final type or says what is allowed."""

from __future__ import annotations

import contextlib
import difflib
import math
import numbers
import re
from collections.abc import Collection, Mapping
from typing import Any

from stiffdice.errors import InputError
from stiffdice.scene import units

Vector = tuple[float, float, float]

# Above 2^53 neighbouring whole numbers share one double.
LARGEST_COUNT = 2**53


def shown(value: object) -> str:
    """Return a value as a person typed it, cut to a readable length."""
    text = "nothing" if value is None else repr(value) if value == "" else str(value)
    return text if len(text) <= 60 else text[:57] + "..."


def number(key: str, value: object, unit: str, *, above: float | None = None, at_least: float | None = None) -> float:
    """Return `value` as a finite float within its bounds; a text with a unit, such as `16 mm`, in SI.

    unit: the SI unit, `1` or empty for a number without. Raises InputError for anything else: booleans, other text, NaN
    and infinities included.
    """
    result, told = math.nan, shown(value)
    bounds = "".join(f" {sign} {bound:g}" for sign, bound in ((">", above), (">=", at_least)) if bound is not None)
    allowed = f"allowed is a finite number{bounds}" + (f" [{unit}]" if unit else "")
    if isinstance(value, str):
        allowed += f", or with a unit, as {units.EXAMPLES[unit]}" if unit in units.EXAMPLES else ""
        try:
            result = units.in_si(value, unit)
        except ValueError as error:
            told, allowed = (told, f"{error}; {allowed}") if str(error) else (f"the text '{told}'", allowed)
    elif isinstance(value, numbers.Real) and not isinstance(value, bool):
        with contextlib.suppress(OverflowError):
            result = float(value)
    too_small = (above is not None and result <= above) or (at_least is not None and result < at_least)
    if too_small or not math.isfinite(result):
        raise InputError(f"{key} = {told}: {allowed}")
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
    """Return `value` as three finite floats; raises InputError otherwise.

    Each may be a text with its unit; then all have one, but zeros. One unit for all is written after the bracket.
    """
    value = listed(value)
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        comma = "; write a decimal comma as a point" if isinstance(value, (list, tuple)) and len(value) > 3 else ""
        raise InputError(f"{key} = {shown(value)}: allowed are three finite numbers, as [x, y, z] [{unit}]{comma}")
    x, y, z = (number(f"{key}[{axis}]", part, unit) for axis, part in zip("xyz", value, strict=True))
    if any(isinstance(part, str) for part in value) and any(part for part in value if not isinstance(part, str)):
        raise InputError(f"{key} = {shown(value)}: give every number its unit, or none [{unit}]")
    return x, y, z


def listed(value: object) -> object:
    """Return the text `[x, y, z] unit` as a list of texts, each with the unit; any other value as it is."""
    found = re.fullmatch(r"\s*\[([^][]*)\]([^][]+)", value) if isinstance(value, str) else None
    return [f"{part.strip()} {found[2].strip()}" for part in found[1].split(",")] if found else value


def choice(key: str, value: object, allowed: Collection[str]) -> str:
    """Return `value` if it is one of `allowed`; raises InputError otherwise."""
    if not isinstance(value, str) or value not in allowed:
        raise InputError(f"{key} = {shown(value)}: allowed is {' or '.join(allowed)}{meant(value, allowed)}")
    return value


def meant(word: object, allowed: Collection[str]) -> str:
    """Return `; did you mean ...?` with the word nearest to one that is not allowed; nothing if none is near."""
    close = difflib.get_close_matches(str(word), allowed, n=1)
    return f"; did you mean {close[0]}?" if close else ""


def known_keys(where: str, mapping: object, allowed: Collection[str]) -> Mapping[str, Any]:
    """Return `mapping` if it is one and has no key outside `allowed`; raises InputError otherwise."""
    if not isinstance(mapping, Mapping):
        raise InputError(f"{where or 'the file'} = {shown(mapping)}: allowed are keys: {', '.join(allowed)}")
    for key in mapping:
        if key not in allowed:
            full = f"{where}.{shown(key)}" if where else shown(key)
            raise InputError(f"{full}: unknown key; allowed are {', '.join(allowed)}{meant(key, allowed)}")
    return mapping
