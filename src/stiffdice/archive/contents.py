"""What goes into an archive: the files of a study and of the project that made it, all there and whole; their sizes."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import ZipFile

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
_KINDS = {"figure": SHOWN, "animation": SHOWN, "pdf": SHOWN, "table": SHOWN, "timings": LOGS}

# Of the project, files and whole folders.
_PROJECT = dict.fromkeys(("CHANGELOG.md", "CITATION.cff", "LICENSE", "README.md", "results/README.md"), TEXT)
_PROJECT |= dict.fromkeys(("Makefile", "Snakefile", "pyproject.toml", "src", "workflow"), CODE)
_PROJECT |= {"requirements": LOCK}

# What a job in progress, an interrupted one, a damaged result or Python leaves behind, and archives themselves.
_LEFT_OUT = (".part", ".damaged", ".pyc", "__pycache__", ".zip", ".egg-info")


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
    own = f"config/{study.name}.yaml"
    files = [file for top, kind in _PROJECT.items() for file in tree(root, top, kind)]
    files += [file for file in tree(root, "docs", TEXT) if file.path.endswith(".md")]
    files += [file for path in scenes_of(study.name, root) for file in tree(root, path, CONFIG)]
    # Somebody's own studies Git leaves out, too.
    files += [file for file in tree(root, "config", CONFIG) if file.path == own or "config/my-" not in file.path]
    named = {file.path: file for file in (*files, *_results(study, root))}
    extract.check_names([*named])
    return [named[path] for path in sorted(named)]


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
        told = [dataset.attrs.get(key, "") for key in ("libraries", "engine_versions", "simulator_version")]
        parts = (entry.partition(" ") for entry in "; ".join(map(str, told)).split("; "))
        software |= {(name, version) for name, _, version in parts if version}
    return runs, sorted(software)


def tree(root: Path, top: str, kind: str) -> Iterator[File]:
    """Yield a file of the project, or those in a folder and below it; raises InputError for a link, or if it is none.

    root: the project's folder.
    """
    if not (root / top).exists():
        raise InputError(f"{top}: not here; an archive is made in the project's folder")
    for name, source in manifest.files_in(root / top) if (root / top).is_dir() else [("", root / top)]:
        path = f"{top}/{name}" if name else top
        if any(part.startswith(".") or part.endswith(_LEFT_OUT) for part in name.split("/")):
            continue
        if not manifest.is_regular(source):
            raise InputError(f"{path}: a link; an archive holds files only")
        yield File(path, kind, source)


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


class Size(NamedTuple):
    """So many files; bytes of them unpacked, and packed."""

    files: int
    bytes: int
    packed: int


class Sizes(NamedTuple):
    """What an archive holds, without the three files that describe it.

    kinds: by the name of the kind, those there are, and `all`. runs: how many runs of sweeps; shards: the files that
    hold them.
    """

    kinds: Mapping[str, Size]
    runs: int
    shards: Size

    @classmethod
    def of(cls, archive: ZipFile, files: Sequence[File], runs: Mapping[str, int]) -> Sizes:
        """Return how much room files take in an archive that has them; runs: how many each shard holds."""
        paths = {kind: [file.path for file in files if file.kind == kind] for kind in KINDS}
        paths |= {"all": [file.path for file in files], "shards": list(runs)}
        sizes = {}
        for kind, names in paths.items():
            each = [archive.getinfo(name) for name in names]
            sizes[kind] = Size(len(each), sum(one.file_size for one in each), sum(one.compress_size for one in each))
        shards = sizes.pop("shards")
        return cls({kind: size for kind, size in sizes.items() if size.files}, sum(runs.values()), shards)

    @property
    def sentence(self) -> str:
        """What a run takes, and what a million would; empty if the study has no sweep."""
        if not self.runs:
            return ""
        each, packed = self.shards.bytes / self.runs, self.shards.packed / self.runs
        return (
            f"{self.runs:,} runs in {self.shards.files} shards: {each:.1f} bytes a run, {packed:.1f} packed; "
            f"a million such runs: {in_megabytes(each * 1e6)}, {in_megabytes(packed * 1e6)} packed"
        )

    def as_data(self) -> dict[str, object]:
        """Return it for programs."""
        each, packed = (size / self.runs if self.runs else None for size in self.shards[1:])
        kinds = {kind: size._asdict() for kind, size in self.kinds.items()}
        return {"kinds": kinds, "runs": self.runs, "bytes_per_run": each, "packed_bytes_per_run": packed}

    def __str__(self) -> str:
        lines = [f"{'':22}{'files':>6}{'unpacked':>12}{'packed':>12}"]
        for name, size in self.kinds.items():
            lines.append(f"{name:22}{size.files:6}{in_megabytes(size.bytes):>12}{in_megabytes(size.packed):>12}")
        return "\n".join([*lines, self.sentence]).rstrip("\n")


def in_megabytes(size: float) -> str:
    """Return a number of bytes for people."""
    return f"{size / 1e6:.1f} MB" if size >= 1e5 else f"{size / 1e3:.1f} kB"
