"""Whether two results differ, where, and by how much.

HDF5 files are compared by what they say: values by their bits, in their order among the doubles (ulp), relatively and
absolutely; the shards of a sweep cell by cell, however the cells are dealt to them. Other files count by their bytes.
"""

from __future__ import annotations

import filecmp
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path, PurePosixPath

import xarray as xr

from stiffdice.archive import crate, manifest, preview
from stiffdice.archive.compare.differences import Difference, datasets_difference, holds_runs, runs_difference
from stiffdice.archive.compare.report import Comparison
from stiffdice.archive.extract import unzip
from stiffdice.archive.manifest import is_regular
from stiffdice.errors import InputError
from stiffdice.io import isolation, yaml_loader
from stiffdice.io.reader import open_file
from stiffdice.io.text_file import rows_of
from stiffdice.study import catalogue

# Where the shards of a sweep are, under the sweep's folder, and what says which of them are in use.
SHARDS, LISTED = "shards", "shards.csv"

# What a study keeps of how it was made, and an archive of what is in it: from one rebuild to the next they differ.
_SIDE_FOLDERS = {"logs", "benchmarks", "__pycache__"}
_SIDE_FILES = {"report.html", manifest.NAME, crate.NAME, preview.NAME}

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
            return _folders((left, right), all_files)
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


def _folders(tops: tuple[Path, Path], all_files: bool) -> Comparison:
    found = [{name for name, _ in manifest.files_in(top)} for top in tops]
    one, other = found
    if not all_files:
        # Only one of the two may know what shows timings.
        side = set[str]().union(*map(_side, tops, found))
        one, other = (files - side - set(unlisted(top, files)) for top, files in zip(tops, found, strict=True))
    both = {name for name in one & other if _are_equal(tops[0] / name, tops[1] / name)}
    shards, others = shards_of(one), shards_of(other)
    # What is compared with what, by one name: all shards of a sweep with those of the same sweep, a file with a file.
    pairs: dict[str, Pair] = {}
    told = set(both)
    for name in shards.keys() & others.keys():
        pairs[name] = ([file for file in shards[name] if file not in both], [f for f in others[name] if f not in both])
        # The table beside them says how the cells are dealt.
        told |= {*shards[name], *others[name], f"{Path(name).parent.as_posix()}/{LISTED}"}
    pairs |= {name: ([name], [name]) for name in (one & other) - told}
    data = (top / name for pair in pairs.values() for top, names in zip(tops, pair, strict=True) for name in names)
    refused = isolation.refused(path for path in data if path.suffix == ".h5" and is_regular(path))
    parts = [_difference(name, pair, tops, refused) for name, pair in pairs.items()]
    return Comparison(
        tuple(sorted((part for part in parts if not part.same), key=lambda part: (not part.numbers, part.name))),
        only_a=tuple(sorted(one - other - told)),
        only_b=tuple(sorted(other - one - told)),
        left_out=tuple(sorted(set[str]().union(*found) - (one | other))),
        files=len(one | other) - len((one ^ other) - told),
        identical=len(both),
    )


def _side(top: Path, files: Iterable[str]) -> Iterator[str]:
    """Yield side files, and the figures and tables that show timings.

    The latter as the file of their study says, where that is beside its results, as in an archive.
    """
    known: dict[Path, set[str]] = {}
    for path in map(PurePosixPath, files):
        hidden = any(part.startswith(".") for part in path.parts)
        if hidden or path.name in _SIDE_FILES or not _SIDE_FOLDERS.isdisjoint(path.parts[:-1]):
            yield str(path)
        elif path.parent.name in ("figures", "tables"):
            study = (top / path.parent).resolve().parent
            if study not in known:
                known[study] = set()
                with suppress(InputError):
                    plan = yaml_loader.load(study.parent.parent / "config" / f"{study.name}.yaml")
                    known[study] = catalogue.showing_times(plan)
            if f"{path.parent.name}/{path.stem}" in known[study]:
                yield str(path)


def unlisted(top: Path, files: Iterable[str]) -> Iterator[str]:
    """Yield the shards in a folder that the table beside them does not list; none where it cannot be read."""
    for folder, shards in shards_of(files).items():
        with suppress(InputError):
            listed = listed_in(top / PurePosixPath(folder).with_name(LISTED))
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
    for path in map(PurePosixPath, sorted(names)):
        if path.parent.name == SHARDS and path.suffix == ".h5":
            found.setdefault(str(path.parent), []).append(str(path))
    return found


def _are_equal(a: Path, b: Path) -> bool:
    """Return whether two files, or two links, are the same; links are not followed."""
    if a.is_symlink() or b.is_symlink():
        return a.is_symlink() and b.is_symlink() and a.readlink() == b.readlink()
    return is_regular(a) and is_regular(b) and filecmp.cmp(a, b, shallow=False)


def _difference(name: str, pair: Pair, tops: tuple[Path, Path], refused: Mapping[str, InputError]) -> Difference:
    """Return how files that are not equal differ: two of one name, or all shards of a sweep, named by their folder.

    refused: what another process found wrong with files, by their paths (`isolation.refused`).
    """
    shards = pair != ([name], [name])
    wrong: list[str] = []
    datasets: list[list[xr.Dataset]] = [[], []]
    for letter, top, names, found in zip("AB", tops, pair, datasets, strict=True):
        for path in (top / file for file in names):
            try:
                if not is_regular(path):
                    raise InputError(f"{path}: a link, or no file")
                if str(path) in refused:
                    raise refused[str(path)]
                if path.suffix == ".h5":
                    dataset = open_file(path)
                    if shards and not holds_runs(dataset):
                        raise InputError(f"{path}: holds no runs in cells")
                    found.append(dataset)
            except InputError as error:
                wrong.append(str(error).replace(f"{top}/", f"{letter}: "))
    if not shards and (wrong or not datasets[0]):
        return Difference(name, other=not wrong, unreadable=tuple(wrong))
    try:
        difference = _data_difference(name, *datasets)
    except ValueError as error:  # of xarray, where the shards of one side do not hold the same variables
        return Difference(name, unreadable=(*wrong, f"shards that are not alike: {str(error).splitlines()[0]}"))
    return replace(difference, unreadable=tuple(wrong))


def _data_difference(name: str, a: Sequence[xr.Dataset], b: Sequence[xr.Dataset]) -> Difference:
    """Return how two sets of shards differ, or two files."""
    if all(map(holds_runs, [*a, *b])):
        return runs_difference(name, a, b)
    return datasets_difference(name, a[0], b[0])
