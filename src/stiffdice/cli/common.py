"""What the commands have in common: numbers as people type them, scenes, studies, targets."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from stiffdice.errors import InputError
from stiffdice.scene import validation

if TYPE_CHECKING:
    from stiffdice.study.config import Study

SCHEMA = "workflow/schemas/study.schema.yaml"
# Of a duration over a step size: as near as this to a whole number of steps is rounding.
_WHOLE = 1e-12


def whole(option: str, text: str, *, at_least: int = 1) -> int:
    """Return the whole number in an option's text; 1e5 counts as one."""
    return validation.count(option, _value(text), at_least=at_least)


def number(option: str, text: str, unit: str, *, above: float | None = None) -> float:
    """Return the number in an option's text, which may have a unit; unit: that of the result, `1` if it has none."""
    return validation.number(option, _value(text), unit, above=above)


def _value(text: str) -> float | str:
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return text


def steps_of(text: str, duration: float) -> tuple[int, str]:
    """Return the fewest steps of a duration [s] that are no longer than --dt says, and what to say if they are shorter.

    Nothing is said where the duration is a whole number of them, to rounding.
    """
    asked = number("--dt", text, "s", above=0)
    ratio = duration / asked
    if not ratio <= validation.LARGEST_COUNT:
        raise InputError(f"--dt = {text}: asks for {ratio:.3g} steps; allowed are {validation.LARGEST_COUNT}")
    if round(ratio) > 0 and abs(ratio - round(ratio)) <= _WHOLE * ratio:
        return round(ratio), ""
    steps = math.ceil(ratio)
    count = f"{steps} step{'s' if steps > 1 else ''}"
    return steps, f"{count} of {duration / steps:.9g} s: {asked:g} s does not divide the duration, {duration:g} s"


def scene_words(options: argparse.Namespace, changes: Sequence[str]) -> list[str]:
    """Return the arguments that name the same scene to another command, with changes as `key.path=value`."""
    preset = [] if options.preset is None else ["--preset", options.preset]
    return [options.scene, *preset, *(word for change in changes for word in ("--set", change))]


def check_folder() -> None:
    """Raise InputError unless this is the project's folder."""
    if not Path(SCHEMA).is_file():
        raise InputError(f"{SCHEMA}: No such file; call this in the project's folder")


def study_of(name: str) -> Study:
    """Return the study in config/NAME.yaml; raises InputError if it is none, or outside of the project's folder."""
    from stiffdice.study import config

    check_folder()
    if not config.NAME.fullmatch(name):
        raise InputError(f"STUDY = {name}: allowed is the name of a file in config/, without .yaml")
    return config.load(f"config/{name}.yaml", SCHEMA)


def target_of(text: str | Path, force: bool, is_ours: Callable[[Path], bool], *sources: str | Path) -> Path:
    """Return the path of a file to write, named with -o.

    is_ours: whether a file that is there may be replaced. sources: files that are read. Raises InputError for one of
    these, and for a file that is not ours unless `force`; OutputError if no file can be written there.
    """
    from stiffdice.io.writer import check_target

    target = check_target(text)
    if target.exists() and any(Path(source).exists() and target.samefile(source) for source in sources):
        raise InputError(f"{target}: is the input itself; name another file for the output")
    if force or not target.exists() or target.stat().st_size == 0 or is_ours(target):
        return target
    raise InputError(f"{target}: is there already, and no such file of stiffdice; name another, or add --force")


def picture_target(option: str, text: str | Path, endings: Sequence[str], force: bool, *sources: str | Path) -> Path:
    """Return the path of a picture to write, as `target_of`; raises InputError for an ending not among these, too."""
    if Path(text).suffix not in endings:
        allowed = f"{', '.join(endings[:-1])} or {endings[-1]}" if len(endings) > 1 else endings[0]
        raise InputError(f"{option} = {text}: allowed is the name of a file that ends in {allowed}")
    return target_of(text, force, _is_our_picture, *sources)


def _is_our_picture(path: Path) -> bool:
    """Return whether a picture says that stiffdice drew it, as all formats of ours do; a PDF file near its end."""
    return b"stiffdice" in path.read_bytes()
