"""Whether an archive, a folder of results or a file is what it was when it was made. Nothing of it is executed."""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

import h5py
import xarray as xr

from stiffdice.archive import manifest
from stiffdice.archive.compare import folders
from stiffdice.archive.consistency import check as sanity
from stiffdice.archive.consistency import sweeps, words
from stiffdice.archive.crate import NAME as CRATE
from stiffdice.archive.extract import unzip
from stiffdice.archive.verify_report import Report
from stiffdice.errors import InputError, RefusedError
from stiffdice.io import isolation, schema
from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.reader import open_file, parts
from stiffdice.io.text_file import text_of
from stiffdice.study import config as studies
from stiffdice.study import job_log, output_digest, provenance
from stiffdice.sweep.collect import collect

_LARGEST_TEXT = 20_000_000  # bytes of a manifest or a crate's description, of some 30,000 files; as JSON up to 0.5 GB
_SCHEMA = Path("workflow/schemas/study.schema.yaml")
_SHARD = re.compile("[0-9a-f]{12}")
# Of a job, under the folder of its study's results.
_LOG = re.compile("((?:.*/)?)logs/.+[.]log")
# Files of these formats need not hold all that the checks look at.
_BEFORE_SANITY = ("1.0", "1.1")

Tell = Callable[[float], None]


def verify(path: str | Path, tell: Tell = lambda done: None) -> Report:
    """Return what was checked of an archive (zip or unpacked), a folder of results or an HDF5 file, and what fails.

    Checked are digests, both ways, where there is a manifest; the crate's description; and of every HDF5 file its seal
    and checksums, its structure, its schema and whether its numbers can be (`consistency`), of a sweep also whether its
    shards add up to it and its frontier follows from it. tell: called with the fraction done. A zip file is unpacked
    into a temporary folder. Raises InputError if there is nothing to check, or a zip file that must not be unpacked.
    """
    place = Path(path)
    if place.is_dir():
        return _Folder(place, str(path), tell).checked()
    if not place.is_file():
        raise InputError(f"{path}: {'not a file or folder' if place.exists() else 'No such file or folder'}")
    if h5py.is_hdf5(path):
        report = Report(str(path), "file")
        _Files(report, {place.name: place}, {}, tell).check_all()
        return report
    damaged: dict[str, str] = {}
    with tempfile.TemporaryDirectory(prefix="stiffdice-verify-") as temporary:
        folder = Path(temporary) / "archive"
        unzip(place, folder, lambda done: tell(done / 2), damaged=damaged)
        if not (folder / manifest.NAME).is_file() and manifest.NAME not in damaged:
            raise RefusedError(f"{path}: has no {manifest.NAME}; not an archive of stiffdice")
        return _Folder(folder, str(path), lambda done: tell((1 + done) / 2), "archive", damaged).checked()


class _Folder:
    """Checks a folder: an archive's if it has a manifest, otherwise one of results."""

    def __init__(
        self, folder: Path, path: str, tell: Tell, kind: str = "", damaged: Mapping[str, str] | None = None
    ) -> None:
        self._folder, self._tell = folder, tell
        self._damaged = dict(damaged or {})
        self._is_archive = kind == "archive" or (folder / manifest.NAME).is_file()
        self.report = Report(path, kind or ("unpacked archive" if self._is_archive else "folder of results"))
        self._files = dict(self._regular())

    def _regular(self) -> Iterator[tuple[str, Path]]:
        """Yield the files by their paths with /; links, and what is neither file nor folder, fail."""
        for name, path in manifest.files_in(self._folder):
            if not manifest.is_regular(path):
                self.report.fail(name, "a link or a special file; allowed are files and folders")
            elif self._is_archive or not _is_left_behind(path.name):
                yield name, path

    def checked(self) -> Report:
        """Check all of it; raises InputError if there is nothing to check."""
        report = self.report
        data = {name: path for name, path in self._files.items() if name.endswith(".h5")}
        if not self._is_archive and not data:
            raise InputError(f"{report.path}: holds neither {manifest.NAME} nor any .h5 file; nothing to check")
        for name, reason in self._damaged.items():
            report.fail(name, reason)
        if self._is_archive:
            report.count("files", len(self._files))
            digests = {name: manifest.digest_of(path) for name, path in self._files.items()}
            self._check_manifest(digests)
            self._check_crate(digests)
            self._check_made()
        else:
            report.note(f"digests (there is no {manifest.NAME})")
            self._check_asked()
        _Files(report, data, self._files, self._tell).check_all()
        return report

    def _text(self, name: str) -> str:
        """Return the text of a file; raises RefusedError, not naming it."""
        try:
            return text_of(self._files[name], _LARGEST_TEXT)
        except InputError as error:
            raise RefusedError(_reason(error, self._files[name])) from None

    def _check_asked(self) -> None:
        """Check a study's results against what it asks now, in the project's folder."""
        name = self._folder.resolve().name
        try:
            if not _SCHEMA.is_file() or self._folder.resolve() != Path("results", name).resolve():
                raise InputError("this is not its project's folder")
            stale = provenance.stale(provenance.of(studies.load(f"config/{name}.yaml", _SCHEMA)), self._folder)
        except InputError as error:
            self.report.note(f"whether a study asks for these results ({error})")
            self._check_made()
            return
        for result, reason in stale.items():
            self.report.fail(result.files[0], f"stale: {reason}")

    def _check_made(self) -> None:
        """Check results against the digests that their jobs' logs say."""
        untold = {name for name in self._files if name.endswith(".h5")}
        for name, path in self._files.items():
            if not (log := _LOG.fullmatch(name)) or (told := job_log.read(path)) is None:
                continue
            there = [file for file in told.made if log[1] + file in self._files]
            untold.difference_update(log[1] + file for file in there)
            for file in output_digest.changed(told, self._folder / log[1], *there):
                self.report.fail(log[1] + file, output_digest.reason(told, [file]))
        if untold:
            self.report.note(f"whether {len(untold)} .h5 files are what their jobs made (no log says it)")

    def _check_manifest(self, digests: Mapping[str, str]) -> None:
        report = self.report
        try:
            listed = manifest.parse(self._text(manifest.NAME)) if manifest.NAME in self._files else {}
        except RefusedError as error:
            report.fail(manifest.NAME, _reason(error, manifest.NAME))
            return
        report.count("digests", len(listed))
        for name, digest in listed.items():
            if name in self._damaged:
                continue
            if name not in digests:
                report.fail(name, f"missing, but listed in {manifest.NAME}")
            elif digests[name] != digest:
                report.fail(name, f"changed: its SHA-256 is {digests[name]}, listed is {digest}")
        for name in sorted(digests.keys() - listed.keys() - {manifest.NAME}):
            report.fail(name, f"there, but not listed in {manifest.NAME}")

    def _check_crate(self, digests: Mapping[str, str]) -> None:
        """Check that the crate's description can be read, and that what it says of files is so."""
        if CRATE in self._damaged:
            return
        if CRATE not in self._files:
            self.report.fail(CRATE, "missing; an archive is an RO-Crate")
            return
        try:
            entities = {str(entity["@id"]): entity for entity in json.loads(self._text(CRATE))["@graph"]}
        except RefusedError as error:
            self.report.fail(CRATE, str(error))
            return
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            self.report.fail(CRATE, f"not an RO-Crate's description ({type(error).__name__}: {error})")
            return
        for needed in ("./", CRATE):
            if needed not in entities:
                self.report.fail(CRATE, f"has no entity {needed}")
        for identifier, entity in entities.items():
            types = entity.get("@type")
            if "File" in (types if isinstance(types, list) else [types]) and "://" not in identifier:
                self._check_entity(unquote(identifier).removeprefix("./"), entity, digests)

    def _check_entity(self, name: str, entity: Mapping[str, Any], digests: Mapping[str, str]) -> None:
        self.report.count("described_files")
        if name in self._damaged:
            return
        if name not in self._files:
            self.report.fail(name, f"missing, but described in {CRATE}")
            return
        size = self._files[name].stat().st_size
        told_size, told_digest = entity.get("contentSize", size), entity.get("sha256", digests[name])
        if str(told_size) != str(size):
            self.report.fail(name, f"{size} bytes, but {told_size} in {CRATE}")
        if told_digest != digests[name]:
            self.report.fail(name, f"its SHA-256 is {digests[name]}, but {told_digest} in {CRATE}")


def _is_left_behind(name: str) -> bool:
    """Return whether an interrupted command left a file: it has no name of its own yet."""
    return name.startswith(".") and name.endswith(".part")


class _Files:
    """Checks HDF5 files, and what one says of another.

    data: the HDF5 files, by their names; files: all of the folder. Another process has tried the data before: a file
    that crashes it, or takes it too long, is not opened here.
    """

    def __init__(self, report: Report, data: Mapping[str, Path], files: Mapping[str, Path], tell: Tell) -> None:
        self._report, self._data, self._files, self._tell = report, data, files, tell
        self._unread: set[str] = set()
        self._refused = isolation.refused(data.values())
        self._read, self._size = 0, sum(path.stat().st_size for path in data.values())

    def check_all(self) -> None:
        """Check each file, and each sweep with its shards and its frontier, one against the other."""
        done: set[str] = set()
        for name in sorted(name for name in self._data if PurePosixPath(name).name == "sweep.h5"):
            done |= self._check_sweep(PurePosixPath(name).parent)
        for name in self._data:
            if name not in done:
                self._check(name)

    def _check(self, name: str) -> None:
        """Check one file by itself."""
        kind = "shard"
        if PurePosixPath(name).parent.name == folders.SHARDS:
            for _ in self._shard(name):
                pass
        else:
            dataset = self._opened(name)
            kind = "" if dataset is None else sanity.kind_of(dataset)
        if kind in sanity.NOT_SEEN:
            self._report.note(sanity.NOT_SEEN[kind])

    def _check_sweep(self, folder: PurePosixPath) -> set[str]:
        """Check a sweep with its shards and its frontier; return what was checked."""
        whole, edges = str(folder / "sweep.h5"), str(folder / "frontier.h5")
        names = self._shards_of(folder)
        collected = self._opened(whole)
        if collected is not None and names and all(name in self._data for name in names):
            self._collect_again(whole, collected, names)
        else:
            names = []
            self._report.note(sanity.NOT_SEEN["sweep"])
        frontier = self._opened(edges) if edges in self._data else None
        if collected is not None and frontier is not None:
            self._compare(edges, lambda: sweeps.same_as_found(frontier, collected))
        return {whole, edges, *names}

    def _shards_of(self, folder: PurePosixPath) -> list[str]:
        """Return the shards that a sweep was collected from; those that are not there fail."""
        table = str(folder / folders.LISTED)
        if table not in self._files:
            return folders.shards_of(self._data).get(str(folder / folders.SHARDS), [])
        try:
            shards = folders.listed_in(self._files[table])
        except InputError as error:
            self._report.fail(table, _reason(error, self._files[table]))
            return []
        if not all(_SHARD.fullmatch(shard or "") for shard in shards):
            self._report.fail(table, "names a shard that is none; allowed are 12 hexadecimal digits")
            return []
        names = [str(folder / folders.SHARDS / f"{shard}.h5") for shard in shards]
        for name in names:
            if name not in self._files:
                self._report.fail(name, f"missing, but listed in {table}")
        return names

    def _collect_again(self, whole: str, collected: xr.Dataset, names: Sequence[str]) -> None:
        """Check the shards of a sweep, and that they add up to it."""
        left = list(names)

        def each() -> Iterator[xr.Dataset]:
            while left:
                yield from self._shard(left.pop())

        try:
            criteria = meanings_of(collected["criterion"])
            tolerances = dict(zip(criteria, map(float, collected["tolerance"].values), strict=True))
            again = collect(each(), tolerances)
        except Exception as error:  # whatever hostile shards make of it
            for _ in each():  # those that it did not come to
                pass
            self._report.fail(whole, f"its shards do not add up to a sweep ({_reason(error)})")
            return
        if self._unread.isdisjoint(names):
            self._compare(whole, lambda: sweeps.same_as_collected(collected, again))
        else:
            self._report.note(f"whether the shards of {whole} add up to it (not all can be read)")

    def _compare(self, name: str, compared: Callable[[], list[str]]) -> None:
        try:
            self._report.fail(name, *compared())
        except Exception as error:  # whatever hostile files make of it
            self._report.fail(name, f"cannot be computed again ({_reason(error)})")

    def _opened(self, name: str) -> xr.Dataset | None:
        """Return a file's dataset, checked; none if it cannot be read."""
        for dataset in list(self._admitted(name, lambda path: iter([open_file(path)]))):
            if sanity.kind_of(dataset) == "run":
                self._report.count("runs")
            self._check_dataset(name, dataset)
            return dataset
        return None

    def _shard(self, name: str) -> Iterator[xr.Dataset]:
        """Yield the parts of a shard, checked, as far as it can be read."""
        first = 0
        for part in self._admitted(name, parts):
            cells = part.sizes["cell"]
            self._report.count("runs", cells * part.sizes.get("member", 1))
            self._check_dataset(name, part, f"cells {first} to {first + cells - 1}, counted from {first}: ")
            yield part
            first += cells

    def _admitted(self, name: str, read: Callable[[Path], Iterator[xr.Dataset]]) -> Iterator[xr.Dataset]:
        """Yield what is read of a file; if it cannot be read to its end, the file fails."""
        path = self._data[name]
        self._report.count("hdf5_files")
        try:
            if str(path) in self._refused:
                raise self._refused[str(path)]
            yield from read(path)
        except Exception as error:  # whatever a hostile file makes of its readers
            self._report.fail(name, _reason(error, path))
            self._unread.add(name)
        self._read += path.stat().st_size
        self._tell(self._read / max(1, self._size))

    def _check_dataset(self, name: str, dataset: xr.Dataset, where: str = "") -> None:
        problems = schema.problems(dataset) + words.problems(dataset)
        version = str(dataset.attrs.get("format_version", ""))
        if version not in _BEFORE_SANITY:
            problems += sanity.problems(dataset)
        else:
            self._report.note(f"numbers in files of format {version} (they have no seal, so no change of them is seen)")
        self._report.fail(name, *(where + problem for problem in problems))


def _reason(error: Exception, source: str | Path = "") -> str:
    """Return what is wrong in one line, not naming the file that it is wrong with."""
    if isinstance(error, InputError):
        return str(error).removeprefix(f"{source}: ")
    return f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}"
