"""What goes into an archive: the files of a study and of the project that made it, all there and whole."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from stiffdice import __version__
from stiffdice.archive import extract, manifest
from stiffdice.errors import InputError
from stiffdice.io import yaml_loader
from stiffdice.io.reader import open_file
from stiffdice.study import outputs
from stiffdice.study.config import Study

# In the order of every list of sizes.
DATA, SHOWN, REPORT, LOGS = "data", "figures and tables", "report", "logs and benchmarks"
CONFIG, CODE, LOCK, TEXT = "studies and scenes", "code and workflow", "locked versions", "text for people"
KINDS = (DATA, SHOWN, REPORT, LOGS, CONFIG, CODE, LOCK, TEXT)
# Of results by their stage; all others are data.
_KINDS = {"figure": SHOWN, "animation": SHOWN, "table": SHOWN, "timings": LOGS}

# Of the project, whole.
_FILES = dict.fromkeys(("CHANGELOG.md", "CITATION.cff", "LICENSE", "README.md", "results/README.md"), TEXT)
_FILES |= dict.fromkeys(("Makefile", "Snakefile", "pyproject.toml"), CODE)
_TREES = {"requirements": LOCK, "src": CODE, "workflow": CODE}

# What a job in progress, an interrupted one, a damaged result or Python leaves behind, and archives themselves.
_LEFT_OUT = (".part", ".damaged", ".pyc", ".zip", ".egg-info")


class File(NamedTuple):
    """A file to be packed: its path in the archive, its kind, where it lies now, and the result that it is part of."""

    path: str
    kind: str
    source: Path
    result: outputs.Result | None = None


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


def read(files: list[File]) -> tuple[dict[str, int], list[tuple[str, str]]]:
    """Read every HDF5 file; return how many runs each shard holds, and name and version of all that made the data.

    Raises RefusedError naming the first file that is not whole.
    """
    runs: dict[str, int] = {}
    software = {("stiffdice", __version__)}
    for file in files:
        if file.result is None or file.source.suffix != ".h5":
            continue
        dataset = open_file(file.source)
        if file.result.stage == "shard":
            runs[file.path] = dataset.sizes["cell"] * dataset.sizes["member"]
        for key in ("libraries", "engine_versions", "simulator_version"):
            for entry in str(dataset.attrs.get(key, "")).split("; "):
                name, _, version = entry.partition(" ")
                if version:
                    software.add((name, version))
    return runs, sorted(software)


def _project(root: Path) -> Iterator[File]:
    for path, kind in _FILES.items():
        if not (root / path).is_file():
            raise InputError(f"{path}: not here; an archive is made in the project's folder")
        yield File(path, kind, root / path)
    for top, kind in _TREES.items():
        yield from tree(root, top, kind)
    for file in tree(root, "docs", TEXT):
        if file.path.endswith(".md"):
            yield file


def _config(study: str, root: Path) -> Iterator[File]:
    for path in scenes_of(study, root):
        if (root / path).is_symlink():
            raise InputError(f"{path}: a link; an archive holds files only")
        yield File(path, CONFIG, root / path)
    for file in tree(root, "config", CONFIG):
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
    stale = outputs.stale(outputs.asked(study, root), root / top)
    if stale:
        first, reason = next(iter(stale.items()))
        raise InputError(
            f"{top}/{first.files[0]}: {reason}, as {len(stale)} of {len(outputs.of(study))} results of this study; "
            f"make study STUDY={study.name} makes them again"
        )
    for result in outputs.of(study):
        for path in result.files:
            yield File(f"{top}/{path}", _KINDS.get(result.stage, DATA), root / top / path, result)
        for side in (result.log, result.benchmark):
            if (root / top / side).is_file():
                yield File(f"{top}/{side}", LOGS, root / top / side)
    if (root / top / "report.html").is_file():
        yield File(f"{top}/report.html", REPORT, root / top / "report.html")
