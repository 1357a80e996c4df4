"""What options of several commands have in common: numbers as people type them, and changes of a scene."""

from __future__ import annotations

import argparse
import math

from stiffdice.errors import InputError

# Of a duration over a step size: as near as this to a whole number of steps is rounding.
_WHOLE = 1e-12


def whole(option: str, text: str) -> int:
    """Return the whole number in an option's text; 1e5 counts as one."""
    from stiffdice.scene import validation

    try:
        return validation.count(option, int(text))
    except ValueError:
        pass
    try:
        return validation.count(option, float(text))
    except ValueError:
        comma = "; write it without a comma" if "," in text else ""
        raise InputError(
            f"{option} = {text}: allowed is a whole number from 1 to {validation.LARGEST_COUNT}{comma}"
        ) from None


def number(option: str, text: str, unit: str, *, above: float | None = None) -> float:
    """Return the number in an option's text, which may have a unit; unit: that of the result, `1` if it has none."""
    from stiffdice.scene import validation

    try:
        value: object = float(text)
    except ValueError:
        value = text
    return validation.number(option, value, unit, above=above)


def steps_of(text: str, duration: float) -> tuple[int, str]:
    """Return the fewest steps of a duration [s] that are no longer than --dt says, and what to say if they are shorter.

    Nothing is said where the duration is a whole number of them, to rounding.
    """
    from stiffdice.scene import validation

    asked = number("--dt", text, "s", above=0)
    ratio = duration / asked
    if not ratio <= validation.LARGEST_COUNT:
        raise InputError(f"--dt = {text}: asks for {ratio:.3g} steps; allowed are {validation.LARGEST_COUNT}")
    if round(ratio) > 0 and abs(ratio - round(ratio)) <= _WHOLE * ratio:
        return round(ratio), ""
    steps = math.ceil(ratio)
    count = f"{steps} step{'s' if steps > 1 else ''}"
    return steps, f"{count} of {duration / steps:.9g} s: {asked:g} s does not divide the duration, {duration:g} s"


def add_changes(command: argparse.ArgumentParser) -> None:
    """Add the options that change a scene, the same for all commands that take one."""
    command.add_argument("--preset", metavar="P", help="as_listed, as_written or corrected: defaults of the physics")
    command.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="KEY.PATH=VALUE",
        type=_change,
        help="set one key of the scene; may be given more than once",
    )


def _change(text: str) -> str:
    """Return a change of a scene; raises ArgumentTypeError where a blank parts its key from its value."""
    key, equals, value = text.partition("=")
    if not equals or (key and not value):
        raise argparse.ArgumentTypeError(f"{text}: write --set {key or 'ground.stiffness'}=VALUE, no blank about the =")
    return text
