"""Whether an archive, a folder of results or a file is what it was when it was made. Nothing of it is executed."""

from __future__ import annotations

import json
import re
import tempfile
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path, PurePosixPath
from typing import NamedTuple
from urllib.parse import unquote

import h5py
import xarray as xr

from stiffdice.archive import manifest
from stiffdice.archive.compare import LISTED, SHARDS, listed_in, shards_of
from stiffdice.archive.consistency import check as sanity
from stiffdice.archive.consistency import equations
from stiffdice.archive.crate import NAME as CRATE
from stiffdice.archive.extract import unzip
from stiffdice.errors import InputError, RefusedError, printable
from stiffdice.io import isolation, schema
from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.reader import open_file, parts
from stiffdice.io.text_file import text_of
from stiffdice.study import config as studies
from stiffdice.study import job_log, outputs
from stiffdice.sweep.collect import collect

_LARGEST_TEXT = 20_000_000  # bytes of a manifest or a crate's description, of some 30,000 files; as JSON up to 0.5 GB
_SCHEMA = Path("workflow/schemas/study.schema.yaml")
# Of a job, under the folder of its study's results.
# Data that a project came with, and what tries a file of them.
_MEASUREMENTS, _READER = "config/measurements/", "stiffdice.scene.tosses"
_LOG = re.compile("((?:.*/)?)logs/.+[.]log")
# Files of these formats need not hold all that the checks look at.
_BEFORE_SANITY = ("1.0", "1.1")


class Problem(NamedTuple):
    """A file that fails, by its path within what was checked, and why."""

    file: str
    reason: str


@dataclass
class Report:
    """What was checked of an archive, a folder or a file.

    kind: `archive`, `unpacked archive`, `folder of results` or `file`. checked: how much, by what it is. not_checked:
    what could not be. problems: what fails.
    """

    path: str
    kind: str
    checked: Counter[str] = field(default_factory=Counter)
    not_checked: list[str] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Whether nothing fails."""
        return not self.problems

    def note(self, what: str) -> None:
        """Say what could not be checked, once."""
        if what not in self.not_checked:
            self.not_checked.append(what)

    def fail(self, file: str, *reasons: str) -> None:
        """Say that a file fails, and why."""
        self.problems += [Problem(file, reason) for reason in reasons]

    def lines(self) -> list[str]:
        """Return it for people: what was checked, a line for all that fails, and the end of it with what was not."""
        checked = ", ".join(_counted(what, number) for what, number in self.checked.items())
        lines = [f"{self.path}: {self.kind}; checked: {checked}"]
        lines += [f"FAILS: {problem.file}: {problem.reason}" for problem in self.problems]
        files = len({problem.file for problem in self.problems})
        end = "nothing fails" if self.ok else f"{_counted('files', files)} must not be trusted"
        lines.append(f"{end}; not checked: {', '.join(self.not_checked)}" if self.not_checked else end)
        return [printable(line) for line in lines]

    def as_json(self) -> str:
        """Return it for programs."""
        problems = [problem._asdict() for problem in self.problems]
        return json.dumps({**vars(self), "problems": problems, "ok": self.ok}, indent=2)


def _counted(what: str, number: int) -> str:
    words = what.replace("hdf5", "HDF5").replace("_", " ")
    return f"{number} {words.removesuffix('s') if number == 1 else words}"


def verify(path: str | Path, progress: Callable[[float], None] = lambda _: None) -> Report:
    """Return what was checked of an archive (zip or unpacked), a folder of results or an HDF5 file, and what fails.

    Checked are digests, both ways, where there is a manifest; the crate's description; and of every HDF5 file its seal
    and checksums, its structure, its schema and whether its numbers can be (`consistency`), of a sweep also whether its
    shards add up to it and its frontier follows from it. A zip file is unpacked into a temporary folder. Raises
    InputError if there is nothing to check, or a zip file that must not be unpacked. progress: takes the fraction done.
    """
    place, damaged = Path(path), dict[str, str]()
    if place.is_dir():
        is_archive = (place / manifest.NAME).is_file()
        report = Report(str(path), "unpacked archive" if is_archive else "folder of results")
        _check_folder(report, place, is_archive, damaged, progress)
        return report
    if not place.is_file():
        raise InputError(f"{path}: {'not a file or folder' if place.exists() else 'No such file or folder'}")
    if h5py.is_hdf5(path):
        report = Report(str(path), "file")
        _Files(report, {place.name: place}, {}, progress).check_all()
        return report
    report = Report(str(path), "archive")
    with tempfile.TemporaryDirectory(prefix="stiffdice-verify-") as temporary:
        folder = Path(temporary) / "archive"
        unzip(place, folder, damaged)
        if not (folder / manifest.NAME).is_file() and manifest.NAME not in damaged:
            raise RefusedError(f"{path}: has no {manifest.NAME}; not an archive of stiffdice")
        _check_folder(report, folder, True, damaged, progress)
    return report


def _check_folder(
    report: Report, folder: Path, is_archive: bool, damaged: Mapping[str, str], progress: Callable[[float], None]
) -> None:
    """Check a folder of results, or an archive's; raises InputError if there is nothing to check."""
    files = {}
    for name, path in manifest.files_in(folder):
        if not manifest.is_regular(path):
            report.fail(name, "a link or a special file; allowed are files and folders")
        elif is_archive or not (path.name.startswith(".") and path.suffix == ".part"):  # an interrupted command's
            files[name] = path
    data = {name: path for name, path in files.items() if _is_result(name)}
    if not is_archive and not data:
        raise InputError(f"{report.path}: holds neither {manifest.NAME} nor any .h5 file; nothing to check")
    for name, reason in damaged.items():
        report.fail(name, reason)
    if is_archive:
        report.checked["files"] += len(files)
        digests = {name: manifest.digest_of(path) for name, path in files.items()} | dict.fromkeys(damaged, "")
        _check_digests(report, manifest.NAME, "listed", files, digests)
        _check_digests(report, CRATE, "described", files, digests)
        _check_made(report, folder, files)
    else:
        report.note(f"digests (there is no {manifest.NAME})")
        _check_asked(report, folder, files)
    _check_measurements(report, {name: path for name, path in files.items() if name.startswith(_MEASUREMENTS)})
    _Files(report, data, files, progress).check_all()


def _is_result(name: str) -> bool:
    """Return whether a file is one of ours, with results; measurements that came with a project are not."""
    return name.endswith(".h5") and not name.startswith(_MEASUREMENTS)


def _check_measurements(report: Report, files: Mapping[str, Path]) -> None:
    """Try the measured tosses among a project's measurements as their reader does."""
    tosses = {str(path): name for name, path in files.items() if name.endswith(".h5")}
    for path, error in isolation.refused(tosses, _READER).items():
        report.fail(tosses[path], _reason(error, Path(path)))


def _check_digests(report: Report, name: str, how: str, files: Mapping[str, Path], digests: Mapping[str, str]) -> None:
    """Check what a manifest or a description says of files; digests: of what is there, empty where it is damaged."""
    if name not in files:
        report.fail(name, *(["missing; every archive has one"] if name not in digests else []))
        return
    try:
        text = text_of(files[name], _LARGEST_TEXT)
        told: Mapping[str, str | None] = manifest.parse(text) if name == manifest.NAME else _described(report, text)
    except InputError as error:
        report.fail(name, _reason(error, files[name]))
        return
    report.checked["digests" if name == manifest.NAME else "described_files"] += len(told)
    for file, digest in told.items():
        if file not in digests:
            report.fail(file, f"missing, but {how} in {name}")
        elif digests[file] and digest not in (None, digests[file]):
            report.fail(file, f"changed: its SHA-256 is {digests[file]}, but {digest} is {how} in {name}")
    if name == manifest.NAME:
        for file in sorted(digests.keys() - told.keys() - {name}):
            report.fail(file, f"there, but not listed in {name}")


def _described(report: Report, text: str) -> dict[str, str | None]:
    """Return the digest that a crate's description says of each file, None where it says none."""
    try:
        entities = {str(entity["@id"]): entity for entity in json.loads(text)["@graph"]}
        types = {name: entity.get("@type") for name, entity in entities.items()}
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise RefusedError(f"not an RO-Crate's description ({type(error).__name__}: {error})") from None
    for needed in sorted({"./", CRATE} - entities.keys()):
        report.fail(CRATE, f"has no entity {needed}")
    return {
        unquote(name).removeprefix("./"): str(entities[name]["sha256"]) if "sha256" in entities[name] else None
        for name, kind in types.items()
        if "File" in (kind if isinstance(kind, list) else [kind]) and "://" not in name
    }


def _check_asked(report: Report, folder: Path, files: Mapping[str, Path]) -> None:
    """Check a study's results against what it asks now, in the project's folder."""
    name = folder.resolve().name
    try:
        if not _SCHEMA.is_file() or folder.resolve() != Path("results", name).resolve():
            raise InputError("this is not its project's folder")
        stale = outputs.stale(outputs.asked(studies.load(f"config/{name}.yaml", _SCHEMA)), folder)
    except InputError as error:
        report.note(f"whether a study asks for these results ({error})")
        _check_made(report, folder, files)
        return
    for result, reason in stale.items():
        report.fail(result.files[0], f"stale: {reason}")


def _check_made(report: Report, folder: Path, files: Mapping[str, Path]) -> None:
    """Check results against the digests that their jobs' logs say."""
    untold = {name for name in files if _is_result(name)}
    for name, path in files.items():
        if not (log := _LOG.fullmatch(name)) or (told := job_log.read(path)) is None:
            continue
        there = [file for file in told.made if log[1] + file in files]
        untold.difference_update(log[1] + file for file in there)
        for file in job_log.changed(told, folder / log[1], *there):
            report.fail(log[1] + file, job_log.reason_of_change(told, [file]))
    if untold:
        report.note(f"whether {len(untold)} .h5 files are what their jobs made (no log says it)")


class _Files:
    """Checks HDF5 files, and what one says of another.

    data: the HDF5 files, by their names; files: all of the folder. Another process has tried the data before: a file
    that crashes it, or takes it too long, is not opened here.
    """

    def __init__(
        self,
        report: Report,
        data: Mapping[str, Path],
        files: Mapping[str, Path],
        progress: Callable[[float], None],
    ) -> None:
        self._report, self._data, self._files, self._progress = report, data, files, progress
        self._unread: set[str] = set()
        self._refused = isolation.refused(data.values())

    def check_all(self) -> None:
        """Check each file, and each sweep with its shards and its frontier, one against the other."""
        done: set[str] = set()
        for name in sorted(name for name in self._data if PurePosixPath(name).name == "sweep.h5"):
            done |= self._check_sweep(PurePosixPath(name).parent)
        for name in (name for name in self._data if name not in done):
            for part in self._checked(name):
                self._report.note(sanity.NOT_SEEN[sanity.kind_of(part)])

    def _check_sweep(self, folder: PurePosixPath) -> set[str]:
        """Check a sweep with its shards and its frontier; return what was checked."""
        whole, edges = str(folder / "sweep.h5"), str(folder / "frontier.h5")
        names = self._shards_of(folder)
        collected = next(self._checked(whole), None)
        if collected is not None and names and all(name in self._data for name in names):
            self._collect_again(whole, collected, names)
        else:
            names = []
            self._report.note(sanity.NOT_SEEN["sweep"])
        frontier = next(self._checked(edges), None) if edges in self._data else None
        if collected is not None and frontier is not None:
            try:
                self._report.fail(edges, *equations.same_as_found(frontier, collected))
            except Exception as error:  # whatever hostile files make of it
                self._report.fail(edges, f"cannot be computed again ({_reason(error)})")
        return {whole, edges, *names}

    def _shards_of(self, folder: PurePosixPath) -> list[str]:
        """Return the shards that a sweep was collected from; those that are not there fail."""
        table = str(folder / LISTED)
        if table not in self._files:
            return shards_of(self._data).get(str(folder / SHARDS), [])
        try:
            names = [str(folder / SHARDS / f"{shard}.h5") for shard in listed_in(self._files[table])]
        except InputError as error:
            self._report.fail(table, _reason(error, self._files[table]))
            return []
        for name in (name for name in names if name not in self._files):
            self._report.fail(name, f"missing, but listed in {table}")
        return names

    def _collect_again(self, whole: str, collected: xr.Dataset, names: Sequence[str]) -> None:
        """Check the shards of a sweep, and that they add up to it."""
        each = chain.from_iterable(map(self._checked, names))
        try:
            criteria = meanings_of(collected["criterion"])
            again = collect(each, dict(zip(criteria, map(float, collected["tolerance"].values), strict=True)))
            found = equations.same_as_collected(collected, again)
        except Exception as error:  # whatever hostile shards make of it
            deque(each, 0)  # those that it did not come to are checked, too
            found = [f"its shards do not add up to a sweep ({_reason(error)})"]
        if self._unread.isdisjoint(names):
            self._report.fail(whole, *found)
        else:
            self._report.note(f"whether the shards of {whole} add up to it (not all can be read)")

    def _checked(self, name: str) -> Iterator[xr.Dataset]:
        """Yield a file's dataset, of a shard part by part, checked; if it cannot be read to its end, the file fails."""
        path, cells, report = self._data[name], 0, self._report
        is_shard = PurePosixPath(name).parent.name == SHARDS
        self._progress(report.checked["hdf5_files"] / len(self._data))
        report.checked["hdf5_files"] += 1
        try:
            if str(path) in self._refused:
                raise self._refused[str(path)]
            for part in parts(path) if is_shard else [open_file(path)]:
                where, first = "", cells
                if is_shard:
                    cells += part.sizes["cell"]
                    where = f"cells {first} to {cells - 1}, counted from {first}: "
                if is_shard or sanity.kind_of(part) == "run":
                    report.checked["runs"] += part.sizes.get("cell", 1) * part.sizes.get("member", 1)
                problems, version = schema.problems(part) + sanity.word_problems(part), part.attrs.get("format_version")
                if version in _BEFORE_SANITY:
                    report.note(
                        f"numbers in files of format {version} (they have no seal, so no change of them is seen)"
                    )
                else:
                    problems += sanity.problems(part)
                report.fail(name, *(where + problem for problem in problems))
                yield part
        except Exception as error:  # whatever a hostile file makes of its readers
            report.fail(name, _reason(error, path))
            self._unread.add(name)


def _reason(error: Exception, source: str | Path = "") -> str:
    """Return what is wrong in one line, not naming the file that it is wrong with."""
    if isinstance(error, InputError):
        return str(error).removeprefix(f"{source}: ")
    return f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}"
