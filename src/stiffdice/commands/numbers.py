"""Numbers in options, as people type them."""

from __future__ import annotations

import math

from stiffdice.errors import InputError

# Of a duration over a step size: as near as this to a whole number of steps is rounding.
_WHOLE = 1e-12


def whole(option: str, text: str) -> int:
    """Return the whole number in an option's text; 1e5 counts as one."""
    from stiffdice import checks

    try:
        return checks.count(option, int(text))
    except ValueError:
        pass
    try:
        return checks.count(option, float(text))
    except ValueError:
        comma = "; write it without a comma" if "," in text else ""
        raise InputError(
            f"{option} = {text}: allowed is a whole number from 1 to {checks.LARGEST_COUNT}{comma}"
        ) from None


def number(option: str, text: str, unit: str, *, above: float | None = None) -> float:
    """Return the number in an option's text, which may have a unit; unit: that of the result, `1` if it has none."""
    from stiffdice import checks

    try:
        value: object = float(text)
    except ValueError:
        value = text
    return checks.number(option, value, unit, above=above)


def steps_of(text: str, duration: float) -> tuple[int, str]:
    """Return the fewest steps of a duration [s] that are no longer than --dt says, and what to say if they are shorter.

    Nothing is said where the duration is a whole number of them, to rounding.
    """
    from stiffdice import checks

    asked = number("--dt", text, "s", above=0)
    ratio = duration / asked
    if not ratio <= checks.LARGEST_COUNT:
        raise InputError(f"--dt = {text}: asks for {ratio:.3g} steps; allowed are {checks.LARGEST_COUNT}")
    if round(ratio) > 0 and abs(ratio - round(ratio)) <= _WHOLE * ratio:
        return round(ratio), ""
    steps = math.ceil(ratio)
    count = f"{steps} step{'s' if steps > 1 else ''}"
    return steps, f"{count} of {duration / steps:.9g} s: {asked:g} s does not divide the duration, {duration:g} s"
