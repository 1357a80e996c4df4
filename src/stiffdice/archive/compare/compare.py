"""Whether two results differ, where, and by how much.

HDF5 files are compared by what they say: values by their bits, in their order among the doubles (ulp), relatively and
absolutely; the shards of a sweep cell by cell, however the cells are dealt to them. Other files count by their bytes.
"""

from __future__ import annotations

import filecmp
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import xarray as xr

from stiffdice.archive.compare import folders
from stiffdice.archive.compare.datasets import Difference, datasets_difference, holds_runs, runs_difference
from stiffdice.archive.compare.folders import Folder
from stiffdice.archive.compare.report import Comparison
from stiffdice.archive.extract import unzip
from stiffdice.archive.manifest import is_regular
from stiffdice.errors import InputError
from stiffdice.io import isolation
from stiffdice.io.reader import open_file

__all__ = ["Comparison", "compare"]

Pair = tuple[Sequence[str], Sequence[str]]  # of A and of B


def compare(a: Path, b: Path, all_files: bool = False) -> Comparison:
    """Return how two files of ours, two folders or two archives (zip) differ; an archive is a folder, too.

    all_files: whether side files (logs, times, the report, what else differs from one rebuild to the next) count.
    Raises InputError if one is not there, is no file of ours, or if a file is to be compared with a folder.
    """
    with ExitStack() as stack:
        left, right = (_unpacked(path, stack) for path in (a, b))
        if left.is_dir() != right.is_dir():
            raise InputError(f"{a}, {b}: a folder and a file; allowed are two files, two folders, two archives")
        if left.is_dir():
            return _folders(folders.read("A", left), folders.read("B", right), all_files)
        difference = _data_difference(left.name, [open_file(left)], [open_file(right)])
        identical = int(filecmp.cmp(left, right, shallow=False))
    return Comparison(() if difference.same else (difference,), files=1, identical=identical)


def _unpacked(path: Path, stack: ExitStack) -> Path:
    """Return the path of a file or folder, of an archive that of a folder with what is in it, until the stack ends."""
    if path.is_dir():
        return path
    if not path.is_file():
        raise InputError(f"{path}: {'neither a file nor a folder' if path.exists() else 'No such file or directory'}")
    if not zipfile.is_zipfile(path):
        isolation.admit(path)
        return path
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="stiffdice-diff-")), "archive")
    unzip(path, folder)
    return folder


def _folders(left: Folder, right: Folder, all_files: bool) -> Comparison:
    # Only one of the two may know what shows timings.
    side = frozenset() if all_files else left.side | right.side
    one, other = (part.files - side - (frozenset() if all_files else part.unlisted) for part in (left, right))
    both = {name for name in one & other if _are_equal(left.top / name, right.top / name)}
    shards, others = folders.shards_of(one), folders.shards_of(other)
    # What is compared with what, by one name: all shards of a sweep with those of the same sweep, a file with a file.
    pairs: dict[str, Pair] = {}
    told = set(both)
    for name in shards.keys() & others.keys():
        pairs[name] = ([file for file in shards[name] if file not in both], [f for f in others[name] if f not in both])
        # The table beside them says how the cells are dealt.
        told |= {*shards[name], *others[name], f"{Path(name).parent.as_posix()}/{folders.LISTED}"}
    pairs |= {name: ([name], [name]) for name in (one & other) - told}
    refused = isolation.refused(
        folder.top / name
        for pair in pairs.values()
        for folder, names in zip((left, right), pair, strict=True)
        for name in names
        if name.endswith(".h5") and is_regular(folder.top / name)
    )
    found = [_difference(name, pair, (left, right), refused) for name, pair in pairs.items()]
    return Comparison(
        tuple(sorted((part for part in found if not part.same), key=lambda part: (not part.numbers, part.name))),
        only_a=tuple(sorted(one - other - told)),
        only_b=tuple(sorted(other - one - told)),
        left_out=tuple(sorted((left.files | right.files) - (one | other))),
        files=len(one | other) - len((one ^ other) - told),
        identical=len(both),
    )


def _are_equal(a: Path, b: Path) -> bool:
    """Return whether two files, or two links, are the same; links are not followed."""
    if a.is_symlink() or b.is_symlink():
        return a.is_symlink() and b.is_symlink() and a.readlink() == b.readlink()
    return is_regular(a) and is_regular(b) and filecmp.cmp(a, b, shallow=False)


def _difference(name: str, pair: Pair, sides: tuple[Folder, Folder], refused: Mapping[str, InputError]) -> Difference:
    """Return how files that are not equal differ: two of one name, or all shards of a sweep, named by their folder.

    refused: what another process found wrong with files, by their paths (`isolation.refused`).
    """
    shards = pair != ([name], [name])
    if not (shards or name.endswith(".h5")):
        plain = all(is_regular(side.top / name) for side in sides)
        return Difference(name, other=plain, unreadable=() if plain else (f"{name}: a link, or no file",))
    wrong: list[str] = []
    datasets: list[list[xr.Dataset]] = [[], []]
    for side, names, found in zip(sides, pair, datasets, strict=True):
        for file in names:
            try:
                found.append(_opened(side.top / file, shards, refused))
            except InputError as error:
                wrong.append(str(error).replace(f"{side.top}/", f"{side.letter}: "))
    if wrong and not shards:
        return Difference(name, unreadable=tuple(wrong))
    try:
        difference = _data_difference(name, *datasets)
    except ValueError as error:  # of xarray, where the shards of one side do not hold the same variables
        return Difference(name, unreadable=(*wrong, f"shards that are not alike: {str(error).splitlines()[0]}"))
    return replace(difference, unreadable=tuple(wrong))


def _opened(path: Path, shard: bool, refused: Mapping[str, InputError]) -> xr.Dataset:
    if not is_regular(path):
        raise InputError(f"{path}: a link, or no file")
    if str(path) in refused:
        raise refused[str(path)]
    dataset = open_file(path)
    if shard and not holds_runs(dataset):
        raise InputError(f"{path}: holds no runs in cells")
    return dataset


def _data_difference(name: str, a: Sequence[xr.Dataset], b: Sequence[xr.Dataset]) -> Difference:
    """Return how two sets of shards differ, or two files."""
    if all(map(holds_runs, [*a, *b])):
        return runs_difference(name, a, b)
    return datasets_difference(name, a[0], b[0])
