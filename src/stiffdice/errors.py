"""What goes wrong through no fault of the program, told in one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Self

LONGEST = 1000  # signs of a message


def printable(text: object) -> str:
    """Return text on one line, with nothing that a terminal obeys: such characters by their escapes, as `\\x1b`."""
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in str(text))


class StiffdiceError(Exception):
    """An error whose message is written for people: one printable line; the command line exits with status 2.

    Every error below is one, so that `except StiffdiceError` catches all that is no fault of the program.
    """

    def __init__(self, message: str = "") -> None:
        told = printable(message)
        super().__init__(told if len(told) <= LONGEST else told[: LONGEST - 3] + "...")


class InputError(StiffdiceError):
    """A scene, study, option or file that cannot be used; names the key, the value and what is allowed."""

    def within(self, source: str) -> Self:
        """Return the same error, told with where it was found."""
        return type(self)(f"{source}: {self}")


class NotInstalledError(InputError):
    """An engine that is asked for and is not there; a study leaves out what needs it."""


class RefusedError(InputError):
    """A file that is there and cannot be trusted: damaged, of another program, or made to mislead."""


class OutputError(StiffdiceError):
    """A result that could not be stored; nothing is left under its final name."""


@contextmanager
def told_within(source: str) -> Iterator[None]:
    """Let an InputError be told with where it was found."""
    try:
        yield
    except InputError as error:
        raise error.within(source) from None
