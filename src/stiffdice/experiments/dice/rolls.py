"""Rolls of a real die: what a YAML file of counts says, checked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from stiffdice.errors import InputError
from stiffdice.io import yaml_loader
from stiffdice.scene import die, validation

_KEYS = ("counts", "source", "note")


@dataclass(frozen=True)
class Rolls:
    """How often each face came up: six whole numbers, of the faces 1 to 6; where they are from, and a note.

    Raises InputError for anything else.
    """

    counts: tuple[int, ...]
    source: str = ""
    note: str = ""

    def __post_init__(self) -> None:
        given = self.counts
        if not isinstance(given, (list, tuple)) or len(given) != len(die.FACES):
            raise InputError(
                f"counts = {validation.shown(given)}: allowed are six whole numbers >= 0, of the faces 1 to 6 in order"
            )
        counts = (validation.count(f"counts[{face}]", n, at_least=0) for face, n in zip(die.FACES, given, strict=True))
        object.__setattr__(self, "counts", tuple(counts))
        if self.total == 0:
            raise InputError("counts = [0, 0, 0, 0, 0, 0]: allowed are counts of one roll at least")
        for key in ("source", "note"):
            if not isinstance(getattr(self, key), str):
                raise InputError(f"{key} = {validation.shown(getattr(self, key))}: allowed is a text")

    @property
    def total(self) -> int:
        """How many there were in all."""
        return sum(self.counts)


def load(path: str | Path) -> Rolls:
    """Return the counts in a YAML file; raises InputError naming the file, the key, the value and what is allowed."""
    data = yaml_loader.load(path)
    try:
        keys = validation.known_keys("", data, _KEYS)
        if "counts" not in keys:
            raise InputError("counts is missing: allowed are six whole numbers >= 0, of the faces 1 to 6 in order")
        return Rolls(**keys)
    except InputError as error:
        raise error.within(str(path)) from None
