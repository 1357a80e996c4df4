"""Whether two results differ, where, and by how much.

HDF5 files are compared by what they say: values by their bits, in their order among the doubles (ulp), relatively and
absolutely; the shards of a sweep cell by cell, however the cells are dealt to them. Other files count by their bytes.
"""

from __future__ import annotations

import filecmp
import json
import tempfile
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path, PurePosixPath

import xarray as xr

from stiffdice.archive import crate, manifest
from stiffdice.archive.differences import Aspect, Difference, Values, data_difference, holds_runs
from stiffdice.archive.extract import unzip
from stiffdice.archive.manifest import is_regular
from stiffdice.errors import InputError, printable
from stiffdice.io import isolation, yaml_loader
from stiffdice.io.reader import open_file
from stiffdice.io.text_file import rows_of
from stiffdice.study import catalogue

# Where the shards of a sweep are, under the sweep's folder, and what says which of them are in use.
SHARDS, LISTED = "shards", "shards.csv"

# What a study keeps of how it was made, and an archive of what is in it: from one rebuild to the next they differ.
_SIDE_FOLDERS = {"logs", "benchmarks", "__pycache__"}
_SIDE_FILES = {"report.html", manifest.NAME, crate.NAME, crate.PREVIEW}

# Of files, of attributes, and of variables of one file: so many are shown to people.
SHOWN = 20
_WIDE = 40  # characters of a text that are shown

# What of files of one name may differ, by the field that says so; the gravest first.
_KINDS = {
    "unreadable": "data that cannot be read",
    "values": "numbers",
    "only_a": "cells only in A",
    "only_b": "cells only in B",
    "shapes": "variables, types or sizes",
    "attributes": "attributes",
    "other": "other bytes",
}

Pair = tuple[Sequence[str], Sequence[str]]  # of A and of B


@dataclass(frozen=True)
class Comparison:
    """What differs between A and B.

    differences: of the files that both have and that are not the same. only_a, only_b: files that one has. left_out:
    side files. files: how many were compared, identical: how many of them byte for byte the same.
    """

    differences: tuple[Difference, ...] = ()
    only_a: tuple[str, ...] = ()
    only_b: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    files: int = 0
    identical: int = 0

    @property
    def same(self) -> bool:
        """Whether A and B say the same, however it is stored, side files aside."""
        return not (self.differences or self.only_a or self.only_b)

    @property
    def numbers_same(self) -> bool:
        """Whether all data are there in both, and their values are equal, bit by bit, whatever else differs."""
        alone = any(name.endswith(".h5") for name in (*self.only_a, *self.only_b))
        return not (alone or any(part.numbers for part in self.differences))

    def lines(self) -> list[str]:
        """Return what differs as text: the verdict, what explains it, then file by file, as much as one can read."""
        found = Counter(aspect for part in self.differences for aspect in part.attributes)
        # What made them explains the rest; what only one of the two says is often only newer.
        ordered = sorted(found.items(), key=lambda item: (None in (item[0].a, item[0].b), -item[1]))
        lines = [self.verdict]
        lines += _first([[f"{_against(one)} ({_count(count, 'file')})"] for one, count in ordered], "attributes")
        for side, names in (("A", self.only_a), ("B", self.only_b)):
            lines += _first([[f"only in {side}: {name}"] for name in names], "files")
        told = ((part.name, [f"  {line}" for line in _about(part)]) for part in self.differences)
        lines += _first([["", name, *about] if about else [] for name, about in told], "files")
        if self.left_out:
            left_out = _count(len(self.left_out), "file")
            lines += ["", f"left out: {left_out} of logs, times and the like; --all takes them"]
        return [printable(line) for line in lines]

    @property
    def verdict(self) -> str:
        """Whether A and B differ, in one line."""
        files = _count(self.files, "file")
        if self.same and self.identical == self.files:
            return f"the same, byte for byte: {files}"
        if self.same:
            return f"the same numbers and attributes, stored otherwise: {files}, {self.identical} of them byte for byte"
        how = []
        for field, what in _KINDS.items():
            if number := sum(bool(getattr(part, field)) for part in self.differences):
                how.append(f"{what} in {_count(number, 'file')}{_up_to(self.differences) if field == 'values' else ''}")
        for side, names in (("A", self.only_a), ("B", self.only_b)):
            how += [f"{_count(len(names), 'file')} only in {side}"] if names else []
        return f"{'the numbers are the same; ' if self.numbers_same else ''}different: {', '.join(how)}"

    def as_json(self) -> str:
        """Return all of it as JSON, with text for the numbers that JSON does not have."""
        content = asdict(self) | {"verdict": self.verdict, "same": self.same, "numbers_same": self.numbers_same}
        return json.dumps(json.loads(json.dumps(content), parse_constant=lambda name: repr(float(name))), indent=2)


def compare(
    a: Path, b: Path, all_files: bool = False, progress: Callable[[float], None] = lambda _: None
) -> Comparison:
    """Return how two files of ours, two folders or two archives (zip) differ; an archive is a folder, too.

    all_files: whether side files (logs, times, the report, what else differs from one rebuild to the next) count.
    progress: takes the fraction done. Raises InputError if one is not there, is no file of ours, or if a file is to be
    compared with a folder.
    """
    with ExitStack() as stack:
        left, right = (_unpacked(path, stack) for path in (a, b))
        if left.is_dir() != right.is_dir():
            raise InputError(f"{a}, {b}: a folder and a file; allowed are two files, two folders, two archives")
        if left.is_dir():
            return _folders((left, right), all_files, progress)
        difference = data_difference(left.name, [open_file(left)], [open_file(right)])
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


def _folders(tops: tuple[Path, Path], all_files: bool, progress: Callable[[float], None]) -> Comparison:
    found = [{name for name, _ in manifest.files_in(top)} for top in tops]
    one, other = found
    if not all_files:
        # Only one of the two may know what shows timings.
        side = set[str]().union(*map(_side, tops, found))
        one, other = (files - side - set(unlisted(top, files)) for top, files in zip(tops, found, strict=True))
    both, shared = set(), one & other
    for number, name in enumerate(shared):
        progress(number / len(shared) / 2)  # then those that are not byte for byte the same
        if _are_equal(tops[0] / name, tops[1] / name):
            both.add(name)
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
    parts = []
    for number, (name, pair) in enumerate(pairs.items()):
        progress((1 + number / len(pairs)) / 2)
        parts.append(_difference(name, pair, tops, refused))
    return Comparison(
        tuple(sorted((part for part in parts if not part.same), key=lambda part: (not part.numbers, part.name))),
        only_a=tuple(sorted(one - other - told)),
        only_b=tuple(sorted(other - one - told)),
        left_out=tuple(sorted(set[str]().union(*found) - (one | other))),
        files=len(one | other) - len((one ^ other) - told),
        identical=len(both),
    )


def _side(top: Path, files: Iterable[str]) -> Iterator[str]:
    """Yield side files, and the figures and tables that show timings, as their study's file beside its results says."""

    @cache
    def timed(study: Path) -> set[str]:
        with suppress(InputError):
            return catalogue.showing_times(yaml_loader.load(study.parent.parent / "config" / f"{study.name}.yaml"))
        return set()

    for path in map(PurePosixPath, files):
        folder = path.parent.name
        kept = any(part.startswith(".") for part in path.parts) or not _SIDE_FOLDERS.isdisjoint(path.parts[:-1])
        shown = folder in ("figures", "tables") and (top / path.parent).resolve().parent
        if kept or path.name in _SIDE_FILES or (shown and f"{folder}/{path.stem}" in timed(shown)):
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
    """Return how files that are not equal differ; refused: what another process found wrong with some, by path."""
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
        difference = data_difference(name, *datasets)
    except ValueError as error:  # of xarray, where the shards of one side do not hold the same variables
        return Difference(name, unreadable=(*wrong, f"shards that are not alike: {str(error).splitlines()[0]}"))
    return replace(difference, unreadable=tuple(wrong))


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _first(parts: Sequence[Iterable[str]], what: str) -> list[str]:
    """Return the lines of the first parts, and how many more parts there are."""
    more = [[f"… and {len(parts) - SHOWN} more {what}"]] if len(parts) > SHOWN else []
    return [line for part in (*parts[:SHOWN], *more) for line in part]


def _up_to(parts: Sequence[Difference]) -> str:
    """Return the largest difference of floats in all files."""
    sizes = [(one.ulp, one.relative or 0.0) for part in parts for one in part.values if one.ulp is not None]
    return f" (up to {_relative(max(ulp for ulp, _ in sizes), max(size for _, size in sizes))})" if sizes else ""


def _relative(ulp: int, relative: float | None) -> str:
    number = str(ulp) if ulp < 1_000_000 else f"{ulp:.2g}"
    return f"{number} ulp, {relative:.2g} of the value"


def _about(part: Difference) -> Iterator[str]:
    """Yield how the files of one name differ, line by line."""
    yield from part.unreadable
    for side, cells in (("A", part.only_a), ("B", part.only_b)):
        if cells:
            yield f"only in {side}: {_count(len(cells), 'cell')}, {cells[0]}" + (", …" if len(cells) > 1 else "")
    yield from _first([list(_about_values(values)) for values in part.values], "variables")
    yield from _first([[_against(shape)] for shape in part.shapes], "variables")
    if part.other:
        yield _KINDS["other"]
    yield from part.notes


def _about_values(values: Values) -> Iterator[str]:
    sizes = [] if values.ulp is None else [_relative(values.ulp, values.relative)]
    if values.absolute is not None:
        sizes.append(f"{values.absolute:.3g}" + ("" if values.units == "1" else f" {values.units}"))
    if values.of == 1:
        yield ", ".join([f"{values.variable}: {values.places[0].a} against {values.places[0].b}", *sizes])
        return
    size = f", by up to {', '.join(sizes)}" if sizes else ""
    unmeasured = f" ({values.unmeasured} NaN or infinite)" if values.unmeasured else ""
    yield f"{values.variable}: {values.count} of {_count(values.of, 'value')} differ{size}{unmeasured}"
    yield from _first([[f"  {change}"] for change in values.changes], "changes")
    for place in values.places:
        yield f"  {place.where}: {place.a} against {place.b}"


def _against(aspect: Aspect) -> str:
    """Return what two files say, shortly."""
    a, b = (text if len(text) <= _WIDE else f"{text[: _WIDE - 1]}…" for text in (str(aspect.a), str(aspect.b)))
    if aspect.a is None or aspect.b is None:
        return f"{aspect.name}: only in {'B' if aspect.a is None else 'A'}: {b if aspect.a is None else a}"
    return f"{aspect.name}: {a} against {b}"
