"""What was checked, and what fails."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from stiffdice.errors import printable


class Problem(NamedTuple):
    """A file that fails, by its path within what was checked, and why."""

    file: str
    reason: str


@dataclass
class Report:
    """What was checked of an archive, a folder or a file.

    kind: `archive`, `unpacked archive`, `folder of results` or `file`. counts: how much was checked, by what it is.
    notes: what could not be checked. problems: what fails.
    """

    path: str
    kind: str
    counts: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Whether nothing fails."""
        return not self.problems

    def count(self, what: str, number: int = 1) -> None:
        """Say that so many more were checked."""
        self.counts[what] = self.counts.get(what, 0) + number

    def note(self, what: str) -> None:
        """Say what could not be checked, once."""
        if what not in self.notes:
            self.notes.append(what)

    def fail(self, file: str, *reasons: str) -> None:
        """Say that a file fails, and why."""
        self.problems += [Problem(file, reason) for reason in reasons]

    def lines(self) -> list[str]:
        """Return it for people: what was checked, a line for all that fails, and the end of it with what was not."""
        checked = ", ".join(_counted(what, number) for what, number in self.counts.items())
        lines = [f"{self.path}: {self.kind}; checked: {checked}"]
        lines += [f"FAILS: {problem.file}: {problem.reason}" for problem in self.problems]
        files = len({problem.file for problem in self.problems})
        end = "nothing fails" if self.ok else f"{_counted('files', files)} must not be trusted"
        lines.append("; not checked: ".join([end, *([", ".join(self.notes)] if self.notes else [])]))
        return [printable(line) for line in lines]

    def as_json(self) -> str:
        """Return it for programs."""
        content: dict[str, Any] = {
            "path": self.path,
            "kind": self.kind,
            "ok": self.ok,
            "checked": self.counts,
            "not_checked": self.notes,
            "problems": [problem._asdict() for problem in self.problems],
        }
        return json.dumps(content, indent=2)


def _counted(what: str, number: int) -> str:
    words = what.replace("hdf5", "HDF5").replace("_", " ")
    return f"{number} {words.removesuffix('s') if number == 1 else words}"
