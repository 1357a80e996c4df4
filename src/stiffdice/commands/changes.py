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
        help="set one key of the scene; may be given more than once",
    )
