"""Whether an archive, a folder of results or a file is what it was when it was made. Nothing of it is executed."""

from __future__ import annotations

import json
import os
import re
import stat
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

import xarray as xr

from stiffdice.archive import manifest
from stiffdice.archive.consistency import check as sanity
from stiffdice.archive.consistency import sweeps, words
from stiffdice.archive.extract import unzip
from stiffdice.archive.verify_report import Report
from stiffdice.errors import InputError, RefusedError
from stiffdice.io import isolation, schema
from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.reader import open_file, parts
from stiffdice.io.text_file import rows_of, text_of
from stiffdice.study import config as studies
from stiffdice.study import job_log, output_digest, provenance
from stiffdice.sweep.collect import collect

CRATE = "ro-crate-metadata.json"

_HDF5 = b"\x89HDF\r\n\x1a\n"
_LARGEST_TEXT = 20_000_000  # bytes of a manifest or a crate's description, of some 30,000 files; as JSON up to 0.5 GB
_SCHEMA = Path("workflow/schemas/study.schema.yaml")
_SHARD = re.compile("[0-9a-f]{12}")
# Of a job, under the folder of its study's results.
_LOG = re.compile("((?:.*/)?)logs/.+[.]log")

Tell = Callable[[float], None]


def verify(path: str | Path, tell: Tell | None = None) -> Report:
    """Return what was checked of an archive (zip or unpacked), a folder of results or an HDF5 file, and what fails.

    Checked are digests, both ways, where there is a manifest; the crate's description; and of every HDF5 file its seal
    and checksums, its structure, its schema and whether its numbers can be (`sanity`), of a sweep also whether its
    shards add up to it and its frontier follows from it. tell: called with the fraction done. A zip file is unpacked
    into a temporary folder. Raises InputError if there is nothing to check, or a zip file that must not be unpacked.
    """
    place = Path(path)
    tell = tell or (lambda done: None)
    if place.is_dir():
        return _Folder(place, str(path), tell).checked()
    if not place.is_file():
        raise InputError(f"{path}: {'not a file or folder' if place.exists() else 'No such file or folder'}")
    if _begins_with(place, _HDF5):
        report = Report(str(path), "file")
        files = _Files(report, lambda name: None)
        files.try_apart({place.name: place})
        files.check(place.name, place)
        return report
    damaged: dict[str, str] = {}
    with tempfile.TemporaryDirectory(prefix="stiffdice-verify-") as temporary:
        folder = Path(temporary) / "archive"
        unzip(place, folder, lambda done: tell(done / 2), damaged=damaged)
        if not (folder / manifest.NAME).is_file() and manifest.NAME not in damaged:
            raise RefusedError(f"{path}: has no {manifest.NAME}; not an archive of stiffdice")
        return _Folder(folder, str(path), lambda done: tell((1 + done) / 2), "archive", damaged).checked()


def _begins_with(path: Path, start: bytes) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(len(start)) == start
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None


class _Folder:
    """Checks a folder: an archive's if it has a manifest, otherwise one of results."""

    def __init__(
        self, folder: Path, path: str, tell: Tell, kind: str = "", damaged: Mapping[str, str] | None = None
    ) -> None:
        self._folder, self._tell = folder, tell
        self._damaged = dict(damaged or {})
        self._is_archive = kind == "archive" or (folder / manifest.NAME).is_file()
        self.report = Report(path, kind or ("unpacked archive" if self._is_archive else "folder of results"))
        self._files = self._walked()

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
            tell = self._teller(self._files, 0, 0.5)
            digests = {}
            for name, path in self._files.items():
                digests[name] = manifest.digest_of(path)
                tell(name)
            self._check_manifest(digests)
            self._check_crate(digests)
            self._check_made()
        else:
            report.note(f"digests (there is no {manifest.NAME})")
            self._check_asked()
        files, done = _Files(report, self._teller(data, 0.5 if self._is_archive else 0, 1)), set()
        files.try_apart(data)
        for folder in sorted(
            {str(PurePosixPath(name).parent) for name in data if PurePosixPath(name).name == "sweep.h5"}
        ):
            done |= files.check_sweep(folder, self._files)
        for name, path in data.items():
            if name not in done:
                files.check(name, path)
        return report

    def _teller(self, files: Mapping[str, Path], start: float, end: float) -> Callable[[str], None]:
        """Return what is to be called with every file that is done, to tell how far it is by their sizes."""
        sizes = {name: path.stat().st_size for name, path in files.items()}
        done, total = 0, max(1, sum(sizes.values()))

        def tell(name: str) -> None:
            nonlocal done
            done += sizes.get(name, 0)
            self._tell(start + (end - start) * done / total)

        return tell

    def _walked(self) -> dict[str, Path]:
        """Return the files by their paths with /; links, and what is neither file nor folder, fail."""
        found: dict[str, Path] = {}
        for top, folders, names in os.walk(self._folder):
            folders.sort()
            for name in sorted([*folders, *names]):
                path = Path(top) / name
                relative = path.relative_to(self._folder).as_posix()
                mode = path.lstat().st_mode
                if stat.S_ISREG(mode):
                    if self._is_archive or not _is_left_behind(name):
                        found[relative] = path
                elif not stat.S_ISDIR(mode):
                    self.report.fail(relative, "a link or a special file; allowed are files and folders")
        return found

    def _text(self, name: str) -> str:
        """Return the text of a file; raises RefusedError, not naming it."""
        path = self._files[name]
        try:
            return text_of(path, _LARGEST_TEXT)
        except InputError as error:
            raise RefusedError(str(error).removeprefix(f"{path}: ")) from None

    def _check_asked(self) -> None:
        """Check a study's results against what it asks now, in the project's folder."""
        name = self._folder.resolve().name
        if not _SCHEMA.is_file() or self._folder.resolve() != Path("results", name).resolve():
            self.report.note("whether a study asks for these results, as this is not its project's folder")
            self._check_made()
            return
        try:
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
            report.fail(manifest.NAME, str(error).removeprefix(f"{manifest.NAME}: "))
            return
        report.count("digests", len(listed))
        for name, digest in listed.items():
            if name in self._damaged:
                continue
            if name not in digests:
                report.fail(name, f"missing, but listed in {manifest.NAME}")
            elif digests[name] != digest:
                report.fail(name, f"changed: its SHA-256 is {digests[name]}, listed is {digest}")
        for name in digests:
            if name not in listed and name != manifest.NAME:
                report.fail(name, f"there, but not listed in {manifest.NAME}")

    def _check_crate(self, digests: Mapping[str, str]) -> None:
        """Check that the crate's description can be read, and that what it says of files is so."""
        if CRATE in self._damaged:
            return
        if CRATE not in self._files:
            self.report.fail(CRATE, "missing; an archive is an RO-Crate")
            return
        try:
            graph = json.loads(self._text(CRATE))["@graph"]
            entities = {str(entity["@id"]): entity for entity in graph}
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
    """Checks HDF5 files, and what one says of another."""

    def __init__(self, report: Report, tell: Callable[[str], None]) -> None:
        self._report, self._tell = report, tell
        self._unread: set[str] = set()
        self._refused: dict[str, InputError] = {}

    def try_apart(self, files: Mapping[str, Path]) -> None:
        """Let another process read the files first: one that crashes it, or takes it too long, is not opened here."""
        self._refused = isolation.refused(files.values())

    def check(self, name: str, path: Path) -> None:
        """Check one file by itself."""
        kind = "shard"
        if PurePosixPath(name).parent.name == kind + "s":
            for _ in self._shard(name, path):
                pass
        else:
            dataset = self._opened(name, path)
            kind = "" if dataset is None else sanity.kind_of(dataset)
        if kind in sanity.NOT_SEEN:
            self._report.note(sanity.NOT_SEEN[kind])

    def check_sweep(self, folder: str, files: Mapping[str, Path]) -> set[str]:
        """Check a sweep with its shards and its frontier, one against the other; return what was checked."""
        whole, edges, table = (str(PurePosixPath(folder, name)) for name in ("sweep.h5", "frontier.h5", "shards.csv"))
        there = [name for name in files if PurePosixPath(name).parent == PurePosixPath(folder, "shards")]
        names = self._listed(table, folder, files) if table in files else there
        collected = self._opened(whole, files[whole])
        if collected is not None and names and all(name in files for name in names):
            self._collect_again(whole, collected, {name: files[name] for name in names})
        else:
            names = []
            self._report.note(sanity.NOT_SEEN["sweep"])
        frontier = self._opened(edges, files[edges]) if edges in files else None
        if collected is not None and frontier is not None:
            self._compare(edges, lambda: sweeps.same_as_found(frontier, collected))
        return {whole, edges, *names}

    def _listed(self, table: str, folder: str, files: Mapping[str, Path]) -> list[str]:
        """Return the shards that a sweep was collected from; those that are not there fail."""
        try:
            shards = [row["shard"] for row in rows_of(files[table])]
        except (InputError, KeyError) as error:
            self._report.fail(table, f"not a table of shards ({type(error).__name__})")
            return []
        names = [
            str(PurePosixPath(folder, "shards", f"{shard}.h5")) for shard in shards if _SHARD.fullmatch(shard or "")
        ]
        if len(names) != len(shards):
            self._report.fail(table, "names a shard that is none; allowed are 12 hexadecimal digits")
        for name in names:
            if name not in files:
                self._report.fail(name, f"missing, but listed in {table}")
        return names

    def _collect_again(self, whole: str, collected: xr.Dataset, shards: Mapping[str, Path]) -> None:
        """Check the shards of a sweep, and that they add up to it."""

        left = dict(shards)

        def each() -> Iterator[xr.Dataset]:
            while left:
                yield from self._shard(*left.popitem())

        try:
            names = meanings_of(collected["criterion"])
            tolerances = dict(zip(names, map(float, collected["tolerance"].values), strict=True))
            again = collect(each(), tolerances)
        except Exception as error:  # whatever hostile shards make of it
            for _ in each():  # those that it did not come to
                pass
            self._report.fail(whole, f"its shards do not add up to a sweep ({_told(error)})")
            return
        if self._unread.isdisjoint(shards):
            self._compare(whole, lambda: sweeps.same_as_collected(collected, again))
        else:
            self._report.note(f"whether the shards of {whole} add up to it (not all can be read)")

    def _compare(self, name: str, compared: Callable[[], list[str]]) -> None:
        try:
            self._report.fail(name, *compared())
        except Exception as error:  # whatever hostile files make of it
            self._report.fail(name, f"cannot be computed again ({_told(error)})")

    def _opened(self, name: str, path: Path) -> xr.Dataset | None:
        """Return a file's dataset, checked; none if it cannot be read."""
        self._report.count("hdf5_files")
        try:
            self._admit(path)
            dataset = open_file(path)
        except Exception as error:  # whatever a hostile file makes of its readers
            self._report.fail(name, _told(error).removeprefix(f"{path}: "))
            return None
        if sanity.kind_of(dataset) == "run":
            self._report.count("runs")
        self._check_dataset(name, dataset)
        self._tell(name)
        return dataset

    def _shard(self, name: str, path: Path) -> Iterator[xr.Dataset]:
        """Yield the parts of a shard, checked, as far as it can be read."""
        self._report.count("hdf5_files")
        reading, first = parts(path), 0
        while True:
            try:
                self._admit(path)
                part = next(reading)
            except StopIteration:
                self._tell(name)
                return
            except Exception as error:  # whatever a hostile file makes of its readers
                self._report.fail(name, _told(error).removeprefix(f"{path}: "))
                self._unread.add(name)
                return
            cells = part.sizes["cell"]
            self._report.count("runs", cells * part.sizes.get("member", 1))
            self._check_dataset(name, part, f"cells {first} to {first + cells - 1}, counted from {first}: ")
            yield part
            first += cells

    def _admit(self, path: Path) -> None:
        if str(path) in self._refused:
            raise self._refused[str(path)]

    def _check_dataset(self, name: str, dataset: xr.Dataset, where: str = "") -> None:
        problems = schema.problems(dataset) + words.problems(dataset)
        version = str(dataset.attrs.get("format_version", ""))
        if version not in _BEFORE_SANITY:
            problems += sanity.problems(dataset)
        else:
            self._report.note(f"numbers in files of format {version} (they have no seal, so no change of them is seen)")
        self._report.fail(name, *(where + problem for problem in problems))


# Files of these formats need not hold all that the checks look at.
_BEFORE_SANITY = ("1.0", "1.1")


def _told(error: Exception) -> str:
    if isinstance(error, InputError):
        return str(error)
    return f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}"
