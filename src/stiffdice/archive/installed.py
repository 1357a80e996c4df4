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

_CODE = ("Snakefile", "src", "workflow")
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
    return name.partition("/")[0] in _CODE


def has_workflow() -> bool:
    """Return whether the package lies in a checkout of the project, which has the workflow, too."""
    return all((PACKAGE.parents[1] / name).is_file() for name in ("Snakefile", "workflow/run.py"))


def compared(folder: Path, listed: Mapping[str, str]) -> Code:
    """Compare the code of an unpacked archive with the installed, file by file; listed: digests, by path."""
    root, tops, above = PACKAGE.parent, (PACKAGE.name,), "src/"
    if has_workflow():
        root, tops, above = PACKAGE.parents[1], _CODE, ""
    here = (file for top in tops for file in contents.tree(root, top, "code"))
    ours = {f"{above}{file.path}": manifest.digest_of(file.source) for file in here}
    theirs = {name: digest for name, digest in listed.items() if is_code(name)}
    other = sorted(name for name in theirs.keys() | ours.keys() if theirs.get(name) != ours.get(name))
    said = _VERSION.search((folder / "src/stiffdice/__init__.py").read_text(encoding="utf-8", errors="replace"))
    return Code(said[1] if said else "unknown", len(theirs.keys() | ours.keys()), tuple(other))
