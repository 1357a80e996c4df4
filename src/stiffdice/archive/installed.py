"""The code in an archive beside the code that is installed here: whether a run executes the same."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from stiffdice import __version__
from stiffdice.archive import contents, manifest
from stiffdice.dynamics.code_digest import PACKAGE

SHOWN = 5  # of files that are other

_WORKFLOW = ("Snakefile", "workflow/run.py")
_TREES = ("src", "workflow")
_VERSION = re.compile(r'^__version__ = "([0-9A-Za-z.+-]{1,40})"', re.MULTILINE)


class Code(NamedTuple):
    """What an archive's code is beside the installed.

    version: of the archive's code, as it says itself. files: how many files of code the archive or this installation
    has. other: those that are not in both, or not the same in both.
    """

    version: str
    files: int
    other: tuple[str, ...]

    @property
    def is_installed(self) -> bool:
        """Whether all that a run executes is installed here, to the last bit."""
        return not self.other

    def __str__(self) -> str:
        if self.is_installed:
            return f"its code is the installed code, stiffdice {__version__}: all {self.files} files are the same"
        names = ", ".join(self.other[:SHOWN])
        more = f" and {len(self.other) - SHOWN} more" if len(self.other) > SHOWN else ""
        has = "" if has_workflow() else "; a package has no Snakefile and no workflow/, a checkout has"
        return (
            f"its code says to be stiffdice {self.version}, installed is {__version__}{has}: "
            f"{len(self.other)} of {self.files} files differ: {names}{more}"
        )


def is_code(name: str) -> bool:
    """Return whether a run executes a file of an archive, or may."""
    return name == "Snakefile" or name.startswith(tuple(f"{top}/" for top in _TREES))


def has_workflow() -> bool:
    """Return whether the package lies in a checkout of the project, which has the workflow, too."""
    return all((PACKAGE.parents[1] / name).is_file() for name in _WORKFLOW)


def compared(folder: Path, listed: Mapping[str, str]) -> Code:
    """Compare the code of an unpacked archive with the installed, file by file; listed: digests, by path."""
    theirs = {name: digest for name, digest in listed.items() if is_code(name)}
    ours = {name: manifest.digest_of(path) for name, path in _installed().items()}
    other = sorted(name for name in theirs.keys() | ours.keys() if theirs.get(name) != ours.get(name))
    said = _VERSION.search((folder / "src/stiffdice/__init__.py").read_text(encoding="utf-8", errors="replace"))
    return Code(said[1] if said else "unknown", len(theirs.keys() | ours.keys()), tuple(other))


def _installed() -> dict[str, Path]:
    """Return the installed files of code, by where an archive has them."""
    root = PACKAGE.parents[1]
    if not has_workflow():
        return {f"src/{file.path}": file.source for file in contents.tree(PACKAGE.parent, PACKAGE.name, "code")}
    files = (file for top in _TREES for file in contents.tree(root, top, "code"))
    return {"Snakefile": root / "Snakefile"} | {file.path: file.source for file in files}
