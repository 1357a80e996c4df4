"""Whether two results differ, where, and by how much.

HDF5 files are compared by what they say: values by their bits, in their order among the doubles (ulp), relatively and
absolutely; the shards of a sweep cell by cell, however the cells are dealt to them. Other files count by their bytes.
"""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from stiffdice.archive.unzip import unzip
from stiffdice.diff import folders
from stiffdice.diff.cells import holds_runs, runs_difference
from stiffdice.diff.comparison import Comparison
from stiffdice.diff.files import Difference, bytes_difference, data_difference, first_difference
from stiffdice.errors import InputError
from stiffdice.io import quarantine
from stiffdice.io.read import open_file

__all__ = ["Comparison", "compare"]


def compare(a: Path, b: Path, all_files: bool = False) -> Comparison:
    """Return how two files of ours, two folders or two archives (zip) differ; an archive is a folder, too.

    all_files: whether side files (logs, times, the report, what else differs from one rebuild to the next) count.
    Raises InputError if one is not there, is no file of ours, or if a file is to be compared with a folder.
    """
    with ExitStack() as stack:
        left, right = (_unpacked(path, stack) for path in (a, b))
        if left.is_dir() != right.is_dir():
            one, other = (a, b) if left.is_dir() else (b, a)
            raise InputError(f"{one} is a folder, {other} a file: allowed are two files, two folders, two archives")
        return _folders(left, right, all_files) if left.is_dir() else _files(left, right)


def _unpacked(path: Path, stack: ExitStack) -> Path:
    """Return the path of a file or folder, of an archive that of a folder with what is in it, until the stack ends."""
    if not path.exists():
        raise InputError(f"{path}: No such file or directory")
    if path.is_dir() or not _is_zip(path):
        if path.is_file():
            quarantine.admit(path)
        return path
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="stiffdice-diff-")))
    unzip(path, folder)
    quarantine.admit(*sorted(folder.rglob("*.h5")))
    return folder


def _is_zip(path: Path) -> bool:
    if not path.is_file():
        raise InputError(f"{path}: neither a file nor a folder")
    with path.open("rb") as file:
        return file.read(4) in (b"PK\x03\x04", b"PK\x05\x06")


def _files(a: Path, b: Path) -> Comparison:
    if first_difference(a, b) is None:
        if not holds_runs(a):
            open_file(a)  # refuses what is not ours
        return Comparison(files=1, identical=1, single=True)
    difference = _of_data(a.name, a, b)
    if difference.same:
        return Comparison(files=1, single=True, notes=difference.notes)
    return Comparison((difference,), files=1, single=True)


def _of_data(name: str, a: Path, b: Path) -> Difference:
    if not (holds_runs(a) and holds_runs(b)):
        return data_difference(name, a, b)
    difference = runs_difference(name, {"": a}, {"": b})
    if difference.unreadable:
        raise InputError(difference.unreadable[0])
    return difference


def _folders(a: Path, b: Path, all_files: bool) -> Comparison:
    left, right = folders.read(a), folders.read(b)
    # Only one of the two may know what shows timings.
    side = frozenset() if all_files else left.side | right.side | left.timed | right.timed
    one, other = (part.files - side - (frozenset() if all_files else part.unlisted) for part in (left, right))
    sets, told = _sets(left, right, one, other)
    for name in sorted((one & other) - told):
        sets.append(_pair(name, a, b))
    return Comparison(
        tuple(
            sorted(
                (part.difference for part in sets if not part.difference.same),
                key=lambda part: (not part.numbers, part.name),
            )
        ),
        only_a=tuple(sorted(one - other - told)),
        only_b=tuple(sorted(other - one - told)),
        left_out=tuple(sorted((left.files | right.files) - (one | other))),
        files=sum(part.files for part in sets),
        identical=sum(part.identical for part in sets),
        notes=tuple(
            f"{part.difference.name}: {note}" for part in sets if part.difference.same for note in part.difference.notes
        ),
    )


class _Compared(NamedTuple):
    """How files of one name, or all shards of a sweep, differ; how many they are in A, how many byte for byte equal."""

    difference: Difference
    files: int
    identical: int


def _pair(name: str, left: Path, right: Path) -> _Compared:
    a, b = left / name, right / name
    if not (folders.is_regular(a) and folders.is_regular(b)):
        equal = a.is_symlink() and b.is_symlink() and a.readlink() == b.readlink()
        return _Compared(Difference(name, unreadable=() if equal else (_is_no_file(name),)), 1, int(equal))
    offset = first_difference(a, b)
    if offset is None:
        return _Compared(Difference(name), 1, 1)
    if a.suffix != ".h5":
        return _Compared(bytes_difference(name, a, b, offset), 1, 0)
    try:
        return _Compared(_of_data(name, a, b), 1, 0)
    except InputError as error:
        return _Compared(Difference(name, unreadable=(_sided(str(error), left, right),)), 1, 0)


def _sets(
    left: folders.Folder, right: folders.Folder, one: frozenset[str], other: frozenset[str]
) -> tuple[list[_Compared], frozenset[str]]:
    """Return how the shards of each sweep that both have differ, and which files that has told of."""
    shards, others = folders.shards_of(one), folders.shards_of(other)
    found, told = [], set()
    for name in shards.keys() & others.keys():
        compared = _shards(name, left.path, right.path, shards[name], others[name])
        found.append(compared)
        told |= {*shards[name], *others[name]}
        if compared.difference.dealt:
            told.add(f"{Path(name).parent.as_posix()}/{folders.LISTED}")  # it says how they are dealt
    return found, frozenset(told)


def _shards(name: str, a: Path, b: Path, shards: list[str], others: list[str]) -> _Compared:
    """Return how the shards of a sweep differ; those that are equal byte for byte are not read."""
    linked = [shard for shard in {*shards, *others} for top in (a, b) if (top / shard).is_symlink()]
    equal = {
        shard
        for shard in (set(shards) & set(others)).difference(linked)
        if first_difference(a / shard, b / shard) is None
    }
    left, right = (
        {Path(shard).stem: top / shard for shard in files if shard not in equal and shard not in linked}
        for top, files in ((a, shards), (b, others))
    )
    found = runs_difference(name, left, right)
    found = replace(
        found,
        unreadable=(*(_sided(reason, a, b) for reason in found.unreadable), *map(_is_no_file, sorted(set(linked)))),
        notes=(*found.notes, *([f"byte for byte the same besides: {len(equal)} shards"] if equal else [])),
    )
    return _Compared(found, len(shards), len(equal))


def _is_no_file(name: str) -> str:
    return f"{name} is a link, or no file"


def _sided(reason: str, a: Path, b: Path) -> str:
    """Return what is wrong with a file, with the side that it is of instead of where that side is."""
    for side, top in sorted((("A", a), ("B", b)), key=lambda item: -len(str(item[1]))):
        if reason.startswith(f"{top}/"):
            return f"{side}: {reason.removeprefix(f'{top}/')}"
    return reason
