"""Where a command writes, if its user says so: nothing that is not ours is replaced unasked."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from stiffdice.errors import InputError


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
