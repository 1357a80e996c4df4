"""Whether two results differ, where, and by how much.

HDF5 files are compared by what they say: values by their bits, in their order among the doubles (ulp), relatively and
absolutely; the shards of a sweep cell by cell, however the cells are dealt to them. Other files count by their bytes.
"""

from __future__ import annotations

import filecmp
import itertools
import tempfile
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from stiffdice.archive.compare import folders
from stiffdice.archive.compare.datasets import Difference, datasets_difference
from stiffdice.archive.compare.report import Comparison
from stiffdice.archive.compare.shards import holds_runs, runs_difference, shards_difference
from stiffdice.archive.extract import unzip
from stiffdice.errors import InputError
from stiffdice.io import isolation
from stiffdice.io.reader import open_file

__all__ = ["Comparison", "compare"]

_LINE = 160  # characters of a line that are kept


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
        if left.is_dir():
            return _folders(left, right, all_files)
        difference, identical = _data_difference(left.name, left, right), _equal(left, right)
    return Comparison(() if difference.same else (difference,), files=1, identical=int(identical), single=True)


def _unpacked(path: Path, stack: ExitStack) -> Path:
    """Return the path of a file or folder, of an archive that of a folder with what is in it, until the stack ends."""
    if not path.exists():
        raise InputError(f"{path}: No such file or directory")
    if path.is_dir() or not _is_zip(path):
        if path.is_file():
            isolation.admit(path)
        return path
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="stiffdice-diff-")))
    unzip(path, folder)
    return folder


def _is_zip(path: Path) -> bool:
    if not path.is_file():
        raise InputError(f"{path}: neither a file nor a folder")
    with path.open("rb") as file:
        return file.read(4) in (b"PK\x03\x04", b"PK\x05\x06")


def _equal(a: Path, b: Path) -> bool:
    return filecmp.cmp(a, b, shallow=False)


def _data_difference(name: str, a: Path, b: Path) -> Difference:
    """Return how two HDF5 files of ours differ; raises InputError if one cannot be trusted."""
    left, right = open_file(a), open_file(b)
    if holds_runs(left) and holds_runs(right):
        return runs_difference(name, [left], [right])
    return datasets_difference(name, left, right)


def _folders(a: Path, b: Path, all_files: bool) -> Comparison:
    left, right = folders.read(a), folders.read(b)
    # Only one of the two may know what shows timings.
    side = frozenset() if all_files else left.side | right.side
    one, other = (part.files - side - (frozenset() if all_files else part.unlisted) for part in (left, right))
    both = {name for name in one & other if _are_equal(a / name, b / name)}
    refused = isolation.refused(_opened(a, one - both) + _opened(b, other - both))
    shards, others = folders.shards_of(one), folders.shards_of(other)
    found: list[Difference] = []
    told: set[str] = set(both)
    for name in shards.keys() & others.keys():
        one_way, other_way = (
            [top / file for file in part[name] if file not in both] for top, part in ((a, shards), (b, others))
        )
        found.append(_sided(shards_difference(name, one_way, other_way, refused), a, b))
        # The table beside them says how the cells are dealt.
        told |= {*shards[name], *others[name], f"{Path(name).parent.as_posix()}/{folders.LISTED}"}
    found += [_sided(_pair(name, a / name, b / name, refused), a, b) for name in sorted((one & other) - told)]
    return Comparison(
        tuple(sorted((part for part in found if not part.same), key=lambda part: (not part.numbers, part.name))),
        only_a=tuple(sorted(one - other - told)),
        only_b=tuple(sorted(other - one - told)),
        left_out=tuple(sorted((left.files | right.files) - (one | other))),
        files=len(one | other) - len((one ^ other) - told),
        identical=len(both),
    )


def _opened(top: Path, names: Iterable[str]) -> list[Path]:
    """Return those of some files of a folder that are opened to be compared."""
    return [top / name for name in sorted(names) if name.endswith(".h5") and folders.is_regular(top / name)]


def _are_equal(a: Path, b: Path) -> bool:
    """Return whether two files, or two links, are the same; links are not followed."""
    if a.is_symlink() or b.is_symlink():
        return a.is_symlink() and b.is_symlink() and a.readlink() == b.readlink()
    return folders.is_regular(a) and folders.is_regular(b) and _equal(a, b)


def _pair(name: str, a: Path, b: Path, refused: Mapping[str, InputError]) -> Difference:
    """Return how two files of one name that are not equal differ."""
    if not (folders.is_regular(a) and folders.is_regular(b)):
        return Difference(name, unreadable=(f"{name} is a link, or no file",))
    if a.suffix != ".h5":
        return Difference(name, other=True, line=_first_line(a, b))
    if wrong := [str(refused[path]) for path in map(str, (a, b)) if path in refused]:
        return Difference(name, unreadable=tuple(wrong))
    try:
        return _data_difference(name, a, b)
    except InputError as error:
        return Difference(name, unreadable=(str(error),))


def _first_line(a: Path, b: Path) -> tuple[int, str, str] | None:
    """Return the number of the first line in which two texts differ, and both; None if one is no text."""
    with a.open("rb") as left, b.open("rb") as right:
        for number, (one, other) in enumerate(itertools.zip_longest(left, right, fillvalue=b""), start=1):
            if b"\0" in one or b"\0" in other:
                return None
            if one != other:
                texts = [line[:_LINE].decode("utf-8", "replace").rstrip("\r\n") for line in (one, other)]
                return number, texts[0], texts[1]
    return None


def _sided(found: Difference, a: Path, b: Path) -> Difference:
    """Return the same with the side that an unreadable file is of instead of where that side is."""
    told = found.unreadable
    for top, side in sorted(((f"{a}/", "A: "), (f"{b}/", "B: ")), key=lambda item: -len(item[0])):
        told = tuple(reason.replace(top, side) for reason in told)
    return replace(found, unreadable=told)
