"""Options that several commands have: one name, one placeholder, one meaning, one help text for each."""

from __future__ import annotations

import argparse
from typing import Any, NamedTuple


class Option(NamedTuple):
    """Names of an option, what stands for its value (nothing for a switch), and what it says in every command."""

    names: tuple[str, ...]
    metavar: str | None
    told: str


_OPTIONS = (
    Option(("-o", "--output"), "OUT", "where to write the result"),
    Option(("--animate",), "FILE.gif", "draw it as it goes, too"),
    Option(("--contact",), "LAW", "contact law, gated or ungated"),
    Option(("--contact-time",), "X", "how long the ground pushes in a flat landing [s]"),
    Option(("--cores",), "N", "number of cores"),
    Option(("--damping",), "X", "of the ground, per node [kg/s]"),
    Option(("--dt",), "X", "step size, as 1e-4 or '0.1 ms' [s]"),
    Option(("--force",), None, "replace a file that is there and not of stiffdice"),
    Option(("--gravity",), "X", "acceleration of gravity [m/s²]"),
    Option(("--json",), None, "print one JSON object for programs, with units in its keys"),
    Option(("--mass",), "X", "of the cube [kg]"),
    Option(("--preset",), "PRESET", "as_listed, as_written or corrected: defaults of the physics"),
    Option(("-q", "--quiet"), None, "show no progress and no notes"),
    Option(("--restitution",), "X", "speed up over speed down of a flat landing"),
    Option(("--scheme",), "SCHEME", "time-stepping scheme"),
    Option(("--seed",), "N", "of the random numbers"),
    Option(("--set",), "KEY.PATH=VALUE", "set one key of the scene; may be given more than once"),
    Option(("--side",), "X", "of the cube, edge to edge [m]"),
    Option(("--steps",), "N", "number of time steps"),
    Option(("--stiffness",), "X", "of the ground, per node [kg/s²]"),
)
OPTIONS = {option.names[-1]: option for option in _OPTIONS}


def add(to: Any, name: str, more: str = "", **settings: Any) -> None:
    """Add a shared option to a parser or to a group of it.

    more: what its help says besides in this command: a default, what it goes with. settings: as of `add_argument`.
    """
    option = OPTIONS[name]
    if option.metavar is None:
        settings.setdefault("action", "store_true")
    else:
        settings.setdefault("metavar", option.metavar)
    to.add_argument(*option.names, help=f"{option.told}{more}", **settings)


def add_scene(command: argparse.ArgumentParser, without: str = "") -> None:
    """Add the scene, the first argument of commands that take one; without: what holds if it is left out."""
    told = "the physical problem; config/README.md lists its keys"
    optional: dict[str, Any] = {"nargs": "?"} if without else {}
    command.add_argument("scene", metavar="SCENE.yaml", help=f"{told}{without}", **optional)


def add_changes(command: argparse.ArgumentParser) -> None:
    """Add the options that change a scene."""
    add(command, "--preset")
    add(command, "--set", dest="overrides", action="append", default=[], type=_change)


def add_form(command: Any, *, json: bool = True) -> None:
    """Add the options that say what is printed, the last of a command."""
    if json:
        add(command, "--json")
    add(command, "--quiet")


def _change(text: str) -> str:
    """Return a change of a scene; raises ArgumentTypeError where a blank parts its key from its value."""
    key, equals, value = text.partition("=")
    if not equals or (key and not value):
        raise argparse.ArgumentTypeError(f"{text}: write --set {key or 'ground.stiffness'}=VALUE, no blank about the =")
    return text
