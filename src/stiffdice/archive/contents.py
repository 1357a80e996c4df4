"""What goes into an archive: the files of a study and of the project that made it, all there and whole."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from stiffdice.archive import extract, manifest
from stiffdice.errors import InputError
from stiffdice.io import yaml_loader
from stiffdice.io.reader import open_file
from stiffdice.study import outputs, provenance
from stiffdice.study.config import Study

# By their names; the order is that of every list of sizes.
KINDS = {
    "data": "data",
    "figures": "figures and tables",
    "report": "report",
    "logs": "logs and benchmarks",
    "config": "studies and scenes",
    "code": "code and workflow",
    "lock": "locked versions",
    "about": "text for people",
}

# Of the project, whole.
_FILES = {
    "CHANGELOG.md": "about",
    "CITATION.cff": "about",
    "LICENSE": "about",
    "Makefile": "code",
    "README.md": "about",
    "Snakefile": "code",
    "pyproject.toml": "code",
    "results/README.md": "about",
}
_TREES = {"requirements": "lock", "src": "code", "workflow": "code"}

# What a job in progress, an interrupted one, a damaged result or Python leaves behind, and archives themselves.
_LEFT_OUT = (".part", ".damaged", ".pyc", ".zip", ".egg-info")


class File(NamedTuple):
    """A file to be packed: its path in the archive, its kind, where it lies now, and the result that it is part of."""

    path: str
    kind: str
    source: Path
    result: outputs.Result | None = None


class Found(NamedTuple):
    """What the data say: of each shard how many runs it holds, and every library or engine with its version."""

    runs: Mapping[str, int]
    software: tuple[tuple[str, str], ...]


def of(study: Study, root: Path) -> list[File]:
    """Return the files of an archive of a study, sorted by their paths.

    root: the project's folder. Raises InputError naming the first file that is missing, stale or cannot be packed.
    """
    files = {file.path: file for file in (*_project(root), *_config(study.name, root), *_results(study, root))}
    extract.check_names([*files])
    return [files[path] for path in sorted(files)]


def scenes_of(study: str, root: Path) -> list[str]:
    """Return the scenes that config/STUDY.yaml names, relative to the project; raises InputError for one outside."""
    path = f"config/{study}.yaml"
    found: dict[str, None] = {}
    data: Mapping[str, Any] = yaml_loader.load(root / path)
    for kind in ("runs", "sweeps", "experiments", "timings"):
        for name, part in data.get(kind, {}).items():
            scene = os.path.normpath(part["scene"])
            if Path(scene).is_absolute() or scene.startswith(".."):
                raise InputError(
                    f"{path}: {kind}.{name}.scene = {part['scene']}: allowed in an archive is a file of the project, "
                    "by its relative path"
                )
            found[Path(scene).as_posix()] = None
    return list(found)


def read(files: list[File]) -> Found:
    """Read every HDF5 file and return what the data say; raises RefusedError naming the first that is not whole."""
    runs: dict[str, int] = {}
    software: set[tuple[str, str]] = set()
    for file in files:
        if file.result is None or file.source.suffix != ".h5":
            continue
        dataset = open_file(file.source)
        if file.result.stage == "shard":
            runs[file.path] = dataset.sizes["cell"] * dataset.sizes["member"]
        software.update(_software(dataset.attrs))
    return Found(runs, tuple(sorted(software)))


def _software(attributes: Mapping[Any, Any]) -> Iterator[tuple[str, str]]:
    """Yield what a file says of who made it, with versions: this program, libraries, other engines."""
    for key in ("libraries", "engine_versions", "simulator_version"):
        for entry in str(attributes.get(key, "")).split("; "):
            name, _, version = entry.partition(" ")
            if version:
                yield name, version
    if "stiffdice_version" in attributes:
        yield "stiffdice", str(attributes["stiffdice_version"])


def _project(root: Path) -> Iterator[File]:
    for path, kind in _FILES.items():
        if not (root / path).is_file():
            raise InputError(f"{path}: not here; an archive is made in the project's folder")
        yield File(path, kind, root / path)
    for top, kind in _TREES.items():
        yield from tree(root, top, kind)
    for file in tree(root, "docs", "about"):
        if file.path.endswith(".md"):
            yield file


def _config(study: str, root: Path) -> Iterator[File]:
    for path in scenes_of(study, root):
        if (root / path).is_symlink():
            raise InputError(f"{path}: a link; an archive holds files only")
        yield File(path, "config", root / path)
    for file in tree(root, "config", "config"):
        # Somebody's own; Git leaves them out, too.
        if not file.path.startswith("config/my-") or file.path == f"config/{study}.yaml":
            yield file


def tree(root: Path, top: str, kind: str) -> Iterator[File]:
    """Yield the files in a folder of the project and below it; raises InputError for what is none, a link perhaps."""
    if not (root / top).is_dir():
        raise InputError(f"{top}: not here; an archive is made in the project's folder")
    for name, source in manifest.files_in(root / top):
        if any(map(_is_left_out, name.split("/"))):
            continue
        if not manifest.is_regular(source):
            raise InputError(f"{top}/{name}: a link; an archive holds files only")
        yield File(f"{top}/{name}", kind, source)


def _is_left_out(name: str) -> bool:
    return name.startswith(".") or name == "__pycache__" or name.endswith(_LEFT_OUT)


def _results(study: Study, root: Path) -> Iterator[File]:
    top = f"results/{study.name}"
    planned = [(f"{top}/{path}", result) for result in outputs.of(study) for path in result.files]
    missing = [path for path, _ in planned if not (root / path).is_file()]
    if missing:
        raise InputError(
            f"{missing[0]}: not there, as {len(missing)} of {len(planned)} files of this study; "
            f"make study STUDY={study.name} makes what is missing"
        )
    stale = provenance.stale(provenance.of(study, root), root / top)
    if stale:
        first, reason = next(iter(stale.items()))
        raise InputError(
            f"{top}/{first.files[0]}: {reason}, as {len(stale)} of {len(outputs.of(study))} results of this study; "
            f"make study STUDY={study.name} makes them again"
        )
    for path, result in planned:
        yield File(path, _kind(path, result), root / path, result)
    for result in outputs.of(study):
        for side in (f"{top}/{result.log}", f"{top}/{result.benchmark}"):
            if (root / side).is_file():
                yield File(side, "logs", root / side)
    if (root / top / "report.html").is_file():
        yield File(f"{top}/report.html", "report", root / top / "report.html")


def _kind(path: str, result: outputs.Result) -> str:
    if result.stage in {"figure", "animation", "table"}:
        return "figures"
    return "logs" if result.stage == "timings" else "data"
