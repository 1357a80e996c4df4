"""Options that change a scene, the same for all commands that take one."""

from __future__ import annotations

import argparse


def add(command: argparse.ArgumentParser) -> None:
    """Add the options to a command."""
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
