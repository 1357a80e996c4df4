"""Which files of two folders are compared with which, and which are left out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from stiffdice.archive import crate, manifest, preview
from stiffdice.errors import InputError
from stiffdice.io import yaml_loader
from stiffdice.io.text_file import rows_of
from stiffdice.study import catalogue

# What a study keeps of how it was made, and an archive of what is in it: from one rebuild to the next they differ.
SIDE_FOLDERS = ("logs", "benchmarks", "__pycache__")
SIDE_FILES = ("report.html", manifest.NAME, crate.NAME, preview.NAME)

# Where the shards of a sweep are, under the sweep's folder, and what says which of them are in use.
SHARDS, LISTED = "shards", "shards.csv"

# Where results that show something are, under the study's folder.
_SHOWN = ("figures", "tables")


@dataclass(frozen=True)
class Folder:
    """A or B: where it lies, and its files, by their paths in it (with /).

    side: side files, and figures and tables that show timings. unlisted: shards of earlier grids.
    """

    letter: str
    top: Path
    files: frozenset[str]
    side: frozenset[str]
    unlisted: frozenset[str]


def read(letter: str, path: Path) -> Folder:
    """Return what is in a folder; links are not followed. Raises InputError if it cannot be read.

    What shows timings is told by the study's own file, where that is beside its results, as in an archive.
    """
    found = frozenset(name for name, _ in manifest.files_in(path))
    side = {name for name in found if _is_side(PurePosixPath(name))}.union(_timed(path, found))
    return Folder(letter, path, found, frozenset(side), frozenset(_unlisted(path, found)))


def _is_side(path: PurePosixPath) -> bool:
    hidden = any(part.startswith(".") for part in path.parts)
    return hidden or path.name in SIDE_FILES or any(part in SIDE_FOLDERS for part in path.parts[:-1])


def _timed(top: Path, files: Iterable[str]) -> Iterator[str]:
    """Yield the figures and tables that show timings, as the file of their study says, if that is there."""
    known: dict[Path, set[str]] = {}
    for path in map(PurePosixPath, files):
        if path.parent.name in _SHOWN:
            study = (top / path.parent).resolve().parent
            if study not in known:
                known[study] = set()
                with suppress(InputError):
                    plan = yaml_loader.load(study.parent.parent / "config" / f"{study.name}.yaml")
                    known[study] = catalogue.showing_times(plan)
            if f"{path.parent.name}/{path.stem}" in known[study]:
                yield str(path)


def _unlisted(top: Path, files: Iterable[str]) -> Iterator[str]:
    """Yield the shards that the table beside them does not list; none where it cannot be read."""
    for folder, shards in shards_of(files).items():
        try:
            listed = listed_in(top / PurePosixPath(folder).with_name(LISTED))
        except InputError:
            continue
        yield from (name for name in shards if PurePosixPath(name).stem not in listed)


def listed_in(table: Path) -> list[str]:
    """Return the shards that a sweep was collected from; raises InputError if its `shards.csv` is no such table."""
    try:
        return [row["shard"] for row in rows_of(table)]
    except KeyError:
        raise InputError(f"{table}: not a table of shards") from None


def shards_of(names: Iterable[str]) -> dict[str, list[str]]:
    """Return the shards among some files, by the folder that they are in."""
    found: dict[str, list[str]] = {}
    for name in sorted(names):
        path = PurePosixPath(name)
        if path.parent.name == SHARDS and path.suffix == ".h5":
            found.setdefault(path.parent.as_posix(), []).append(name)
    return found
