"""What the commands have in common: how one is added, numbers as people type them, changes of a scene, targets."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeAlias

from stiffdice.errors import InputError

# Of a duration over a step size: as near as this to a whole number of steps is rounding.
_WHOLE = 1e-12

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def add_command(
    commands: Commands, name: str, call: Callable[[argparse.Namespace], int | None], text: str, examples: str
) -> argparse.ArgumentParser:
    """Add a command to the parser, and return its own.

    call: takes the parsed options and returns the exit status, or None for 0. text: what the command does, for its own
    help and the list of commands; examples: come after the options.
    """
    command = commands.add_parser(
        name,
        help=text,
        description=f"{text[0].upper()}{text[1:]}.",
        epilog=examples,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.set_defaults(call=call)
    return command


def add_json(command: argparse.ArgumentParser) -> None:
    """Add the option for programs."""
    command.add_argument("--json", action="store_true", help="the same for programs")


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


def scene_words(options: argparse.Namespace, changes: Sequence[str]) -> list[str]:
    """Return the arguments that name the same scene to another command, with changes as `key.path=value`."""
    preset = [] if options.preset is None else ["--preset", options.preset]
    return [options.scene, *preset, *(word for change in changes for word in ("--set", change))]


def _change(text: str) -> str:
    """Return a change of a scene; raises ArgumentTypeError where a blank parts its key from its value."""
    key, equals, value = text.partition("=")
    if not equals or (key and not value):
        raise argparse.ArgumentTypeError(f"{text}: write --set {key or 'ground.stiffness'}=VALUE, no blank about the =")
    return text


def add_force(command: argparse.ArgumentParser) -> None:
    """Add the option that replaces whatever is there."""
    command.add_argument("--force", action="store_true", help="replace a file that is not of stiffdice, too")


def name_of(option: str, text: str) -> Path:
    """Return the path in an option's text; raises InputError for `-`, which elsewhere means standard output."""
    if text == "-":
        raise InputError(f"{option} -: nothing is written to standard output; allowed is a name (./- for this one)")
    return Path(text)


def target_of(text: str, force: bool, is_ours: Callable[[Path], bool], *sources: str) -> Path:
    """Return the path of a file to write, named with -o.

    is_ours: whether a file that is there may be replaced. sources: files that are read. Raises InputError for one of
    these, and for a file that is not ours unless `force`; OutputError if no file can be written there.
    """
    from stiffdice.io.writer import check_target

    target = check_target(name_of("-o", text))
    if not target.exists():
        return target
    if any(target.samefile(source) for source in sources):
        raise InputError(f"{target}: is the scene itself; name another file for the output")
    try:
        if force or target.stat().st_size == 0 or is_ours(target):
            return target
    except OSError as error:
        raise InputError(f"{target}: {error.strerror}") from None
    raise InputError(f"{target}: is there already, and no such file of stiffdice; name another, or add --force")
