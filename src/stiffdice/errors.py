"""What goes wrong through no fault of the program, told in one line."""

from __future__ import annotations


class StiffdiceError(Exception):
    """An error whose message is written for the person who ran the command: one line, exit status 2."""


class InputError(StiffdiceError):
    """A scene, study, option or file that cannot be used; names the key, the value and what is allowed."""

    def within(self, source: str) -> InputError:
        """Return the same error, told with the file it was found in."""
        return InputError(f"{source}: {self}")


class NotInstalledError(InputError):
    """An engine that is asked for and is not there; a study leaves out what needs it."""

    def within(self, source: str) -> NotInstalledError:
        """Return the same error, told with where it was found."""
        return NotInstalledError(f"{source}: {self}")


class OutputError(StiffdiceError):
    """A result that could not be stored; nothing is left under its final name."""
