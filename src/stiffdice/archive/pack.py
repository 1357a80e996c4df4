"""A study and all that made it, packed into one zip file: the same bytes whenever the same files are packed."""

from __future__ import annotations

import hashlib
import stat
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from stiffdice.archive import contents, crate, manifest, preview
from stiffdice.archive.citation import Citation
from stiffdice.archive.sizes import Size, Sizes, sum_of
from stiffdice.errors import InputError
from stiffdice.io.writer import check_target, whole
from stiffdice.study.config import Study

# What WorkflowHub knows a crate by; zip programs go by the last part of it.
SUFFIX = ".crate.zip"

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the first time that a zip file can say
_UNIX = 3
_AT_ONCE = 1 << 20  # bytes read at a time


class Member(NamedTuple):
    """A file as it is packed: bytes unpacked and packed, whether deflated, the digest of what it holds.

    source: where it lies, or what it holds.
    """

    source: Path | bytes
    size: int
    packed: int
    deflated: bool
    sha256: str
    program: bool = False


class Packed(NamedTuple):
    """A finished archive, how long its file is in bytes, and what it holds."""

    path: Path
    size: int
    sizes: Sizes


def default_target(study: Study, root: Path, version: str) -> Path:
    """Return where an archive is stored if nobody says otherwise: in a folder that is no study's."""
    return root / "results" / "archives" / f"{study.name}-{version}{SUFFIX}"


def pack(study: Study, root: Path, target: str | Path, agent: str | None = None) -> Packed:
    """Pack a finished study, with the project in `root` that made it, into a zip file: an RO-Crate.

    agent: who ran it, if that is to be said. Equal files with equal times give equal bytes (under one version of zlib).
    Raises InputError naming the first file that is missing, damaged or cannot be packed, and OutputError if the archive
    cannot be stored; nothing is left then.
    """
    path = check_target(target)
    files = contents.of(study, root)
    found = contents.read(files)
    members = {file.path: _measured(file.source) for file in files}
    sizes = _sizes(files, members, found.runs)
    facts = crate.Facts(
        study,
        Citation.load(root / "CITATION.cff"),
        files,
        contents.scenes_of(study.name, root),
        {name: (member.size, member.sha256) for name, member in members.items()},
        sizes,
        found.software,
        crate.span_of(files),
        agent,
    )
    for name, text in ((preview.NAME, preview.page(facts)), (crate.NAME, crate.metadata(facts))):
        members[name] = _measured(text.encode())
    listing = manifest.text_of({name: member.sha256 for name, member in members.items()})
    members[manifest.NAME] = _measured(listing.encode())
    _write(path, members)
    return Packed(path, path.stat().st_size, sizes)


def _sizes(files: list[contents.File], members: Mapping[str, Member], runs: Mapping[str, int]) -> Sizes:
    def size_of(path: str) -> Size:
        return Size(1, members[path].size, members[path].packed)

    kinds = {kind: sum_of(size_of(file.path) for file in files if file.kind == kind) for kind in contents.KINDS}
    return Sizes(
        {kind: size for kind, size in kinds.items() if size.files},
        sum(runs.values()),
        sum_of(size_of(path) for path in runs),
    )


def _measured(source: Path | bytes) -> Member:
    """Return what there is to say of a file before it is packed; it is deflated if that makes it shorter."""
    digest, stream = hashlib.sha256(), zlib.compressobj(wbits=-zlib.MAX_WBITS)
    size = packed = 0
    for block in _blocks(source):
        digest.update(block)
        size += len(block)
        packed += len(stream.compress(block))
    packed += len(stream.flush())
    program = isinstance(source, Path) and bool(source.stat().st_mode & stat.S_IXUSR)
    return Member(source, size, min(size, packed), packed < size, digest.hexdigest(), program)


def _blocks(source: Path | bytes) -> Iterator[bytes]:
    if isinstance(source, bytes):
        yield source
        return
    try:
        with source.open("rb") as file:
            while block := file.read(_AT_ONCE):
                yield block
    except OSError as error:
        raise InputError(f"{source}: {error.strerror}") from None


def _write(target: Path, members: Mapping[str, Member]) -> None:
    with whole(target) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name in sorted([*members, *_folders(members)]):
            if name.endswith("/"):
                archive.writestr(_info(name, stat.S_IFDIR | 0o755), b"")
            else:
                _add(archive, name, members[name])


def _folders(names: Iterable[str]) -> set[str]:
    """Return the folders of files, with a / at the end: what a crate describes has to be there."""
    return {f"{folder}/" for name in names for folder in map(str, PurePosixPath(name).parents) if folder != "."}


def _info(name: str, mode: int) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, _EPOCH)
    info.create_system = _UNIX
    info.external_attr = mode << 16
    return info


def _add(archive: zipfile.ZipFile, name: str, member: Member) -> None:
    """Add a file; raises InputError if it is no longer what was measured, OSError if there is no room."""
    info = _info(name, stat.S_IFREG | (0o755 if member.program else 0o644))
    info.compress_type = zipfile.ZIP_DEFLATED if member.deflated else zipfile.ZIP_STORED
    info.file_size = member.size  # so that zipfile takes 64 bits where they are needed
    digest = hashlib.sha256()
    with archive.open(info, "w") as file:
        for block in _blocks(member.source):
            digest.update(block)
            file.write(block)
    if digest.hexdigest() != member.sha256:
        raise InputError(f"{name}: was changed while it was packed; wait until its study is done")
