"""An archive made again from its own content, and compared with what it holds.

`verify` executes nothing of an archive. This does, unless its code is the installed code: `opened` says which it is,
before anything is executed.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

from stiffdice import __version__
from stiffdice.archive import contents, manifest, sandbox
from stiffdice.archive.compare import Comparison, compare
from stiffdice.archive.extract import unzip
from stiffdice.archive.sandbox import Way
from stiffdice.archive.verify import verify
from stiffdice.dynamics.code_digest import PACKAGE
from stiffdice.errors import OutputError, RefusedError, StiffdiceError, printable
from stiffdice.io.text_file import LARGEST_TABLE, text_of
from stiffdice.study import config as studies

LAST_LINES = 20  # of a run that failed, to show
SHOWN = 5  # of files that are other

# In the folder of a rebuild: the archive, out of a sandbox's sight; what runs and what it makes; what the run says.
ARCHIVED, REBUILT, LOG = "archived", "rebuilt", "rebuild.log"
_NOTHING = "nothing"  # an empty folder, for results that are not in their place

# What the installed code is given of an archive: files that Python cannot import.
_READ = (".yaml", ".yml", ".json")

# What a run executes: of an archive, and of this installation.
_CODE = ("Snakefile", "src", "workflow")
_VERSION = re.compile(r'^__version__ = "([0-9A-Za-z.+-]{1,40})"', re.MULTILINE)

_LOG_READ = 1 << 20  # bytes at the end of a log
_LOOK = 1.0  # s between two looks at what has been made


class RunError(StiffdiceError):
    """The run of an archive's workflow failed; told with its last lines, each `printable`."""

    def __init__(self, message: str, last: Sequence[str]) -> None:
        super().__init__(message)
        self._last = [printable(line) for line in last]

    def __str__(self) -> str:
        return "\n  ".join([super().__str__(), *self._last])


class Code(NamedTuple):
    """What an archive's code is beside the installed.

    version: of the archive's code, as it says itself. files: how many files of code the archive or this installation
    has. other: those that are not in both, or not the same in both. As text, how it differs.
    """

    version: str
    files: int
    other: tuple[str, ...]

    @property
    def is_installed(self) -> bool:
        """Whether all that a run executes is installed here, to the last bit."""
        return not self.other

    def __str__(self) -> str:
        names = ", ".join(self.other[:SHOWN])
        more = f" and {len(self.other) - SHOWN} more" if len(self.other) > SHOWN else ""
        has = "" if has_workflow() else "; a package has no Snakefile and no workflow/, a checkout has"
        return (
            f"its code says to be stiffdice {self.version}, installed is {__version__}{has}: "
            f"{len(self.other)} of {self.files} files differ: {names}{more}"
        )


class Opened(NamedTuple):
    """An unpacked archive that passes every check, of which nothing was executed.

    folder: where it lies and is made again; kept: whether it stays. listed: digests of its files, by path. code: what
    its code is beside the installed.
    """

    archive: str
    folder: Path
    kept: bool
    study: str
    listed: Mapping[str, str]
    code: Code


class Rebuilt(NamedTuple):
    """What came of it.

    found: how the archive's results (A) and those that were made (B) differ; logs, times, and what shows times are left
    out. notes: what may explain a difference, and what equality does not say.
    """

    unpacked: Opened
    found: Comparison
    notes: list[str]

    @property
    def ok(self) -> bool:
        """Whether something was compared, and nothing differs."""
        return self.found.files > 0 and self.found.same

    def lines(self) -> list[str]:
        """Return it for people: how much is the same, all that differs, and what may explain it."""
        found, unpacked = self.found, self.unpacked
        ours = unpacked.code.is_installed
        by = f"the installed code, stiffdice {__version__}" if ours else "the archive's own code, not the installed"
        lines = [
            f"{unpacked.archive}: the study {unpacked.study}, made again by {by}: {found.identical} files are the same "
            f"to the last bit, {len(found.differences) + len(found.only_a)} differ; {len(found.left_out)} hold or show "
            "times and are not compared"
        ]
        if not found.same:
            lines += ["DIFFERS, between the archive (A) and what was made again (B):", *found.lines(), ""]
        elif found.identical < found.files:
            lines.append(found.verdict)
        lines += [f"note: {note}" for note in self.notes]
        if unpacked.kept:
            lines.append(f"it lies in {unpacked.folder}: the archive in {ARCHIVED}, what was made again in {REBUILT}")
        return [printable(line) for line in lines]

    def as_json(self) -> str:
        """Return it for programs: how the results compare, as `Comparison.as_json` has it, and what made them."""
        content = {
            "archive": self.unpacked.archive,
            "study": self.unpacked.study,
            "ok": self.ok,
            "code_is_installed": self.unpacked.code.is_installed,
            "folder": str(self.unpacked.folder) if self.unpacked.kept else None,
            "comparison": json.loads(self.found.as_json()),
            "notes": self.notes,
        }
        return json.dumps(content, indent=2)


@contextmanager
def opened(archive: str | Path, folder: str | Path | None = None) -> Iterator[Opened]:
    """Unpack and check an archive, and compare its code with the installed; nothing of it is executed.

    folder: a new one, where to unpack it, make it again and leave it; None takes a temporary one.
    Raises RefusedError if the archive does not pass `verify`, InputError if it cannot be read; nothing is left then,
    but of a run that failed.
    """
    with ExitStack() as unless_done:
        if folder is None:
            temporary = tempfile.TemporaryDirectory(prefix="stiffdice-rebuild-", ignore_cleanup_errors=True)
            place = Path(unless_done.enter_context(temporary))
        else:
            place = Path(folder)
            try:
                place.mkdir(mode=0o700)
            except OSError as error:
                raise OutputError(f"{place}: {error.strerror}; name a new folder") from None
            unless_done.callback(shutil.rmtree, place, ignore_errors=True)
        unzip(archive, place / ARCHIVED)
        listed, study = _checked(archive, place / ARCHIVED)
        code = compared_code(place / ARCHIVED, listed)
        try:
            yield Opened(str(archive), place, folder is not None, study, listed, code)
        except RunError:
            if folder is not None:
                unless_done.pop_all()
            raise
        if folder is not None:
            unless_done.pop_all()


def way_of(unpacked: Opened, in_sandbox: bool = True) -> Way:
    """Return how an archive is made again; raises RefusedError if other code than the installed lacks its sandbox.

    The installed code is as good outside of one; it has the sandbox where there is one, for no network and an end.
    """
    (unpacked.folder / REBUILT).mkdir(exist_ok=True)
    if in_sandbox:
        try:
            return sandbox.sandboxed(unpacked.folder / REBUILT)
        except RefusedError as error:
            if not unpacked.code.is_installed:
                raise RefusedError(
                    f"{unpacked.archive}: {unpacked.code}; that is not run here: {error}; --no-sandbox would let it do "
                    "whatever you can"
                ) from None
    return sandbox.unconfined(unpacked.folder / REBUILT)


def rebuild(unpacked: Opened, way: Way, cores: int = 1, progress: Callable[[float], None] = lambda _: None) -> Rebuilt:
    """Make the results of an archive again, where there are none, and compare them with the archive's own.

    It executes the archive's own code, unless that is the installed. Python and libraries are those of this process.
    progress: takes the fraction of the results that are made. Raises RunError with the run's last lines if that fails.
    """
    notes = other_versions(unpacked.folder / ARCHIVED / "requirements" / "requirements.lock")
    _fill(unpacked)
    notes += [line for line in _run(unpacked, way, cores, progress) if "left out:" in line]
    archived, made = (unpacked.folder.resolve() / top / "results" / unpacked.study for top in (ARCHIVED, REBUILT))
    if made.resolve() != made:  # a link, to the archive's own perhaps
        made = unpacked.folder / _NOTHING
    made.mkdir(parents=True, exist_ok=True)
    found = compare(archived, made)
    # What is only in B was not asked for.
    found = replace(found, only_b=(), left_out=tuple(name for name in found.left_out if (archived / name).exists()))
    if found.files == 0 and found.same:
        notes.append("there was nothing to compare")
    if not unpacked.code.is_installed:
        notes.append(f"{unpacked.code}; equal files say that its own code gives them, not what this computes")
        if way.could:
            notes.append(f"it ran {way}, and could have copied the archive's results")
    return Rebuilt(unpacked, found, notes)


def _checked(archive: str | Path, place: Path) -> tuple[dict[str, str], str]:
    """Return manifest and study of an unpacked archive that passes every check; raises RefusedError for any other."""
    if not (place / manifest.NAME).is_file():
        raise RefusedError(f"{archive}: has no {manifest.NAME}; not an archive of stiffdice")
    for file, reason in verify(place).problems:
        raise RefusedError(f"{archive}: {file}: {reason}; not run. stiffdice verify names all that fails")
    listed = manifest.parse((place / manifest.NAME).read_text(encoding="utf-8"))
    names = {parts[1] for parts in (name.split("/") for name in listed) if parts[0] == "results" and len(parts) > 2}
    if len(names) != 1 or not studies.NAME.fullmatch(min(names)):
        told = ", ".join(sorted(names)) or "none"
        raise RefusedError(f"{archive}: holds results of these studies: {told}; allowed is one")
    (study,) = names
    for needed in ("Snakefile", "workflow/run.py", "src/stiffdice/__init__.py", f"config/{study}.yaml"):
        if needed not in listed:
            raise RefusedError(f"{archive}: has no {needed}; it cannot be made again")
    return listed, study


def other_versions(lock: Path) -> list[str]:
    """Return a line for every package that is here in another version than a lock file says."""
    if not lock.is_file():
        return ["no requirements/requirements.lock: it is not known which versions made it"]
    found = []
    pinned = re.findall(r"^([A-Za-z0-9][A-Za-z0-9._-]*)==([^\s;\\]+)", text_of(lock, LARGEST_TABLE), re.MULTILINE)
    for name, locked in pinned:
        with suppress(PackageNotFoundError):  # for another system, or not needed for a run
            if (here := version(name)) != locked:
                found.append(f"{name} {here} is installed; the archive's lock says {locked}")
    return found


def is_code(name: str) -> bool:
    """Return whether a run executes a file of an archive, or may."""
    return name.partition("/")[0] in _CODE


def has_workflow() -> bool:
    """Return whether the package lies in a checkout of the project, which has the workflow, too."""
    return all((PACKAGE.parents[1] / name).is_file() for name in ("Snakefile", "workflow/run.py"))


def compared_code(folder: Path, listed: Mapping[str, str]) -> Code:
    """Compare the code of an unpacked archive with the installed, file by file; listed: digests, by path."""
    root, tops, above = (PACKAGE.parents[1], _CODE, "") if has_workflow() else (PACKAGE.parent, (PACKAGE.name,), "src/")
    here = (file for top in tops for file in contents.tree(root, top, "code"))
    ours = {f"{above}{file.path}": manifest.digest_of(file.source) for file in here}
    theirs = {name: digest for name, digest in listed.items() if is_code(name)}
    other = sorted(name for name in theirs.keys() | ours.keys() if theirs.get(name) != ours.get(name))
    said = _VERSION.search((folder / "src/stiffdice/__init__.py").read_text(encoding="utf-8", errors="replace"))
    return Code(said[1] if said else "unknown", len(theirs.keys() | ours.keys()), tuple(other))


def _fill(unpacked: Opened) -> None:
    """Copy what runs: without the results, and beside the installed code only files that are read, not executed."""
    for name in (name for name in unpacked.listed if not name.startswith(f"results/{unpacked.study}/")):
        is_read = name.endswith(_READ) and not name.startswith(".")
        if not unpacked.code.is_installed or is_code(name) or is_read:
            target = unpacked.folder / REBUILT / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(unpacked.folder / ARCHIVED / name, target)


def _run(unpacked: Opened, way: Way, cores: int, progress: Callable[[float], None]) -> list[str]:
    """Run the workflow and return what it said; raises RunError. Nothing that it started goes on afterwards."""
    command = [sys.executable, "workflow/run.py", "--cores", str(cores), "study"]
    command += ["--workflow-profile", "workflow/profiles/default", "--config", f"study={unpacked.study}"]
    log = unpacked.folder / LOG
    with log.open("wb") as out:
        running = sandbox.start(way, command, unpacked.folder / REBUILT, out)
        try:
            while running.poll() is None:
                progress(_made(unpacked))
                with suppress(subprocess.TimeoutExpired):
                    running.wait(_LOOK)
        finally:
            sandbox.end(running)
    with log.open("rb") as file:
        file.seek(max(0, log.stat().st_size - _LOG_READ))
        lines = file.read().decode("utf-8", "replace").splitlines()
    if running.returncode != 0:
        where = f", in {unpacked.folder}" if unpacked.kept else ""
        told = f"{unpacked.archive}: its run failed{where}, exit status {running.returncode}:"
        raise RunError(told, lines[-LAST_LINES:])
    return lines


def _made(unpacked: Opened) -> float:
    """Return which fraction of the archive's results has been made again."""
    wanted = [name for name in unpacked.listed if name.startswith(f"results/{unpacked.study}/")]
    return sum((unpacked.folder / REBUILT / name).exists() for name in wanted) / max(1, len(wanted))
