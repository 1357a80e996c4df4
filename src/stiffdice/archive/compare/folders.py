"""Which files of two folders are compared with which, and which are left out."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from stiffdice.archive import manifest
from stiffdice.errors import InputError
from stiffdice.io import yaml_loader
from stiffdice.io.text_file import rows_of
from stiffdice.study import catalogue

# What a study keeps of how it was made, and an archive of what is in it: from one rebuild to the next they differ.
SIDE_FOLDERS = ("logs", "benchmarks", "__pycache__")
SIDE_FILES = ("report.html", manifest.NAME, "ro-crate-metadata.json", "ro-crate-preview.html")

# Where the shards of a sweep are, under the sweep's folder, and what says which of them are in use.
SHARDS, LISTED = "shards", "shards.csv"

# Where results that show something are, under the study's folder.
_SHOWN = ("figures", "tables")


@dataclass(frozen=True)
class Folder:
    """The files of a folder, by their paths in it (with /).

    side: side files, and figures and tables that show timings. unlisted: shards of earlier grids.
    """

    files: frozenset[str]
    side: frozenset[str]
    unlisted: frozenset[str]


def read(path: Path) -> Folder:
    """Return what is in a folder; links are not followed. Raises InputError if it cannot be read.

    What shows timings is told by the study's own file, where that is beside its results, as in an archive.
    """
    found = frozenset(_walk(path))
    side = {name for name in found if _is_side(PurePosixPath(name))}.union(_timed(path, found))
    return Folder(found, frozenset(side), frozenset(_unlisted(path, found)))


def _walk(top: Path) -> Iterator[str]:
    def refuse(error: OSError) -> None:
        raise InputError(f"{error.filename}: {error.strerror}")

    for folder, folders, files in os.walk(top, onerror=refuse):
        linked = [name for name in folders if Path(folder, name).is_symlink()]
        for name in (*files, *linked):
            yield Path(folder, name).relative_to(top).as_posix()


def _is_side(path: PurePosixPath) -> bool:
    hidden = any(part.startswith(".") for part in path.parts)
    return hidden or path.name in SIDE_FILES or any(part in SIDE_FOLDERS for part in path.parts[:-1])


def _timed(top: Path, files: Iterable[str]) -> Iterator[str]:
    shown: dict[Path, set[str]] = {}
    for name in files:
        path = PurePosixPath(name)
        if path.parent.name in _SHOWN:
            study = (top / path).resolve().parent.parent
            if study not in shown:
                shown[study] = _showing_times(study)
            if f"{path.parent.name}/{path.stem}" in shown[study]:
                yield name


def _showing_times(study: Path) -> set[str]:
    """Return what shows timings, of a study whose file is beside its results; none if that cannot be read."""
    try:
        plan = yaml_loader.load(study.parent.parent / "config" / f"{study.name}.yaml")
    except InputError:
        return set()
    return catalogue.showing_times(plan)


def _unlisted(top: Path, files: Iterable[str]) -> Iterator[str]:
    """Yield the shards that the table beside them does not list; none where it cannot be read."""
    for folder, shards in shards_of(files).items():
        try:
            listed = {row["shard"] for row in rows_of(top / PurePosixPath(folder).with_name(LISTED))}
        except (InputError, KeyError):
            continue
        yield from (name for name in shards if PurePosixPath(name).stem not in listed)


def is_regular(path: Path) -> bool:
    """Return whether a path is a file, not a link to one, and nothing that reading might wait for."""
    return path.is_file() and not path.is_symlink()


def shards_of(names: Iterable[str]) -> dict[str, list[str]]:
    """Return the shards among some files, by the folder that they are in."""
    found: dict[str, list[str]] = {}
    for name in sorted(names):
        path = PurePosixPath(name)
        if path.parent.name == SHARDS and path.suffix == ".h5":
            found.setdefault(path.parent.as_posix(), []).append(name)
    return found
