"""An archive made again from its own content, and compared with what it holds.

This executes code of the archive: its Snakefile, its scripts, its library. `verify` does not.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from stiffdice import catalogue
from stiffdice import study as studies
from stiffdice.archive import manifest
from stiffdice.archive.unzip import unzip
from stiffdice.archive.verify import verify
from stiffdice.diff import compare
from stiffdice.errors import InputError, RefusedError, StiffdiceError, printable
from stiffdice.io import yaml_file

LAST_LINES = 20  # of a run that failed, to show

# Under results/STUDY/: what no two runs share.
_SIDE = ("logs/", "benchmarks/", "report.html")

_NOWHERE = "http://127.0.0.1:9"

Tell = Callable[[str], None]


class RunError(StiffdiceError):
    """The run of an archive's own workflow failed; told with its last lines, each `printable`."""

    def __init__(self, message: str, last: Sequence[str]) -> None:
        super().__init__(message)
        self._last = [printable(line) for line in last]

    def __str__(self) -> str:
        return "\n  ".join([super().__str__(), *self._last])


@dataclass
class Rebuilt:
    """What came of it.

    folder: where it lies, if it was kept. same: files that are equal byte by byte. equal: files of equal numbers in
    other bytes. different: by file, what differs. left_out: files that no two runs share: logs, times, and what shows
    times. notes: what may explain a difference.
    """

    archive: str
    study: str
    folder: str | None = None
    same: list[str] = field(default_factory=list)
    equal: list[str] = field(default_factory=list)
    different: dict[str, list[str]] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Whether nothing differs."""
        return not self.different

    def lines(self) -> list[str]:
        """Return it for people: how much is the same, a line for all that differs, and what may explain it."""
        lines = [
            f"{self.archive}: the study {self.study}, made again: {len(self.same)} files are the same to the last bit, "
            f"{len(self.different)} differ; {len(self.left_out)} hold or show times and are not compared"
        ]
        lines += [f"the same numbers in other bytes: {name}" for name in self.equal]
        lines += [f"DIFFERS: {name}: {reason}" for name, reasons in self.different.items() for reason in reasons]
        lines += [f"note: {note}" for note in self.notes]
        if self.folder is not None:
            lines.append(f"it lies in {self.folder}; what was archived in its folder {ARCHIVED}")
        return [printable(line) for line in lines]


# Beside the new results: those of the archive.
ARCHIVED = "archived"


def rebuild(
    archive: str | Path, folder: str | Path | None = None, cores: int = 1, tell: Tell = lambda text: None
) -> Rebuilt:
    """Check an archive, run its own workflow on its own code, without a network, and compare the results with its own.

    folder: where to unpack and run it, new or empty, and to leave it there; None takes a temporary one. The Python and
    the libraries are those of this process; HOME and caches lie in the folder. tell: called with what is done next.
    Raises RefusedError if the archive does not pass `verify`, InputError if it cannot be read, and RunError with the
    run's last lines if that fails.
    """
    with _place(folder) as place:
        tell("unpacking")
        unzip(archive, place)
        try:
            tell("checking")
            listed = _checked(archive, place)
            rebuilt = Rebuilt(str(archive), _study_of(archive, listed), None if folder is None else str(folder))
        except StiffdiceError:
            shutil.rmtree(place)
            raise
        rebuilt.notes += other_versions(place / "requirements" / "requirements.lock")
        top = f"results/{rebuilt.study}"
        (place / ARCHIVED).mkdir()
        (place / top).rename(place / ARCHIVED / rebuilt.study)
        results = {name: digest for name, digest in listed.items() if name.startswith(f"{top}/")}
        log = _run(rebuilt, place, cores, list(results), tell)
        rebuilt.notes += [line for line in log if "left out:" in line]
        _compare(rebuilt, place, results)
        return rebuilt


@contextmanager
def _place(folder: str | Path | None) -> Iterator[Path]:
    """Give a folder to unpack into, which is not there yet or empty."""
    if folder is not None:
        yield Path(folder)
        return
    with tempfile.TemporaryDirectory(prefix="stiffdice-rebuild-", ignore_cleanup_errors=True) as temporary:
        yield Path(temporary) / "archive"


def _checked(archive: str | Path, place: Path) -> dict[str, str]:
    """Return the manifest of an unpacked archive that passes every check; raises RefusedError."""
    if not (place / manifest.NAME).is_file():
        raise RefusedError(f"{archive}: has no {manifest.NAME}; not an archive of stiffdice")
    report = verify(place)
    if not report.ok:
        first = report.problems[0]
        raise RefusedError(f"{archive}: {first.file}: {first.reason}; not run. stiffdice verify names all that fails")
    return manifest.parse((place / manifest.NAME).read_text(encoding="utf-8"))


def _study_of(archive: str | Path, listed: Mapping[str, str]) -> str:
    """Return the name of the study in an archive; raises RefusedError unless there is one, with all that runs it."""
    names = {parts[1] for parts in (name.split("/") for name in listed) if parts[0] == "results" and len(parts) > 2}
    if len(names) != 1 or not studies.NAME.fullmatch(min(names)):
        told = ", ".join(sorted(names)) or "none"
        raise RefusedError(f"{archive}: holds results of these studies: {told}; allowed is one")
    for needed in ("Snakefile", "workflow/run.py", "src/stiffdice/__init__.py", f"config/{min(names)}.yaml"):
        if needed not in listed:
            raise RefusedError(f"{archive}: has no {needed}; it cannot be made again")
    return min(names)


def other_versions(lock: Path) -> list[str]:
    """Return a line for every package that is here in another version than a lock file says."""
    if not lock.is_file():
        return ["no requirements/requirements.lock: it is not known which versions made it"]
    found = []
    pinned = re.findall(
        r"^([A-Za-z0-9][A-Za-z0-9._-]*)==([^\s;\\]+)(?: *;[^\n]*)?", lock.read_text("utf-8"), re.MULTILINE
    )
    for name, locked in pinned:
        try:
            here = version(name)
        except PackageNotFoundError:
            continue  # for another system, or not needed for a run
        if here != locked:
            found.append(f"{name} {here} is installed; the archive's lock says {locked}")
    return found


def _run(rebuilt: Rebuilt, place: Path, cores: int, expected: list[str], tell: Tell) -> list[str]:
    """Run the archive's own workflow and return what it said; raises RunError."""
    command = [sys.executable, "workflow/run.py", "--cores", str(cores), "study"]
    command += ["--workflow-profile", "workflow/profiles/default", "--config", f"study={rebuilt.study}"]
    away = _without_network()
    if not away:
        rebuilt.notes.append("the network could not be taken away from the run; it was given a proxy that is not there")
    log = place / "rebuild.log"
    with log.open("wb") as out:
        running = subprocess.Popen(
            [*away, *command],
            cwd=place,
            env=environment(place),
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            told = -1
            while running.poll() is None:
                there = sum((place / name).exists() for name in expected)
                if there * 10 // len(expected) > told:
                    told = there * 10 // len(expected)
                    tell(f"running: {there} of {len(expected)} files are there")
                time.sleep(0.2)
        finally:
            if running.poll() is None:
                os.killpg(running.pid, signal.SIGTERM)
                running.wait()
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    if running.returncode != 0:
        where = f", in {rebuilt.folder}" if rebuilt.folder else ""
        raise RunError(
            f"{rebuilt.archive}: its run failed{where}, exit status {running.returncode}:", lines[-LAST_LINES:]
        )
    return lines


def environment(place: Path) -> dict[str, str]:
    """Return the environment variables of a run in a folder: nothing of who runs it, and no way to a network."""
    home = place / ".home"
    (home / "tmp").mkdir(parents=True, exist_ok=True)
    kept = {name: os.environ[name] for name in ("LD_LIBRARY_PATH",) if name in os.environ}
    proxies = ("http_proxy", "https_proxy", "ftp_proxy", "all_proxy")
    return kept | {
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.defpath]),
        "HOME": str(home),
        "TMPDIR": str(home / "tmp"),
        "XDG_CACHE_HOME": str(home / "cache"),
        "XDG_CONFIG_HOME": str(home / "config"),
        "LANG": "C.UTF-8",
        "PYTHONPATH": str((place / "src").resolve()),
        "PYTHONNOUSERSITE": "1",
        **dict.fromkeys([*proxies, *map(str.upper, proxies)], _NOWHERE),
    }


def _without_network() -> list[str]:
    """Return what to put before a command so that it has no network; nothing where that is not allowed."""
    for way in (
        ["unshare", "--net"],
        ["unshare", "--map-current-user", "--net"],
        ["unshare", "--map-root-user", "--net"],
    ):
        try:
            if subprocess.run([*way, "true"], capture_output=True, check=False).returncode == 0:
                return way
        except OSError:
            break
    return []


def _compare(rebuilt: Rebuilt, place: Path, results: Mapping[str, str]) -> None:
    """Compare what was made with what was archived, file by file."""
    top = f"results/{rebuilt.study}/"
    timed = catalogue.showing_times(yaml_file.load(place / "config" / f"{rebuilt.study}.yaml"))
    times = tuple(top + name for name in (*_SIDE, *(f"{name}." for name in timed)))
    for name, digest in results.items():
        new = place / name
        if name.startswith(times):
            rebuilt.left_out.append(name)
        elif not new.is_file():
            rebuilt.different[name] = ["was not made"]
        elif manifest.digest_of(new) == digest:
            rebuilt.same.append(name)
        else:
            lines = _told_apart(place / ARCHIVED / name.removeprefix("results/"), new)
            if lines:
                rebuilt.different[name] = lines
            else:
                rebuilt.equal.append(name)


def _told_apart(old: Path, new: Path) -> list[str]:
    """Return what differs between two files that are not equal byte by byte; nothing if it is no number."""
    if old.suffix != ".h5":
        return [f"{old.stat().st_size} bytes archived, {new.stat().st_size} now; not the same"]
    try:
        comparison = compare(old, new)
    except InputError as error:
        return [str(error)]
    return [] if comparison.same else list(comparison.lines())
