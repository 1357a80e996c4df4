"""Numbers in options, as people type them."""

from __future__ import annotations

from stiffdice.errors import InputError


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
        raise InputError(f"{option} = {text}: allowed is a whole number from 1 to {checks.LARGEST_COUNT}") from None


def number(option: str, text: str) -> float:
    """Return the number in an option's text."""
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{option} = {text}: allowed is a number") from None
