"""A study and all that made it, packed into one zip file: the same bytes whenever the same files are packed."""

from __future__ import annotations

import hashlib
import stat
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from typing import NamedTuple
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

from stiffdice.archive import contents, crate, manifest
from stiffdice.archive.contents import Sizes
from stiffdice.archive.extract import AT_ONCE
from stiffdice.errors import InputError
from stiffdice.io.writer import check_target, whole
from stiffdice.study.config import Study

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the first time that a zip file can say
_UNIX = 3


class Packed(NamedTuple):
    """A finished archive, how long its file is in bytes, and what it holds."""

    path: Path
    size: int
    sizes: Sizes


def pack(
    study: Study,
    root: Path,
    target: str | Path,
    agent: str | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> Packed:
    """Pack a finished study, with the project in `root` that made it, into a zip file: an RO-Crate.

    agent: who ran it, if that is to be said. progress: takes the fraction done, by bytes packed.
    Equal files with equal times give equal bytes (under one version of zlib).
    Raises InputError naming the first file that is missing, damaged or cannot be packed, and OutputError if the archive
    cannot be stored; nothing is left then.
    """
    path = check_target(target)
    files = contents.of(study, root)
    digests = {file.path: manifest.digest_of(file.source) for file in files}
    runs, software = contents.read(files)
    with whole(path) as temporary, ZipFile(temporary, "w", ZIP_DEFLATED) as archive:
        # What a crate describes has to be there, folders, too.
        folders = {folder for name in digests for folder in PurePosixPath(name).parents} - {PurePosixPath()}
        for folder in sorted(f"{folder}/" for folder in folders):
            archive.writestr(_info(folder, stat.S_IFDIR | 0o755, ZIP_STORED), b"")
        whole_size, done = sum(file.source.stat().st_size for file in files), 0
        for file in files:
            progress(done / max(1, whole_size))
            _add(archive, file, digests[file.path])
            done += archive.getinfo(file.path).file_size
        facts = crate.Facts(
            study,
            crate.Citation.load(root / "CITATION.cff"),
            files,
            contents.scenes_of(study.name, root),
            {name: (archive.getinfo(name).file_size, digest) for name, digest in digests.items()},
            Sizes.of(archive, files, runs),
            software,
            crate.span_of(files),
            agent,
        )
        # What describes the others comes last.
        for name, text in ((crate.PREVIEW, crate.page(facts)), (crate.NAME, crate.metadata(facts))):
            digests[name] = hashlib.sha256(text.encode()).hexdigest()
            archive.writestr(_info(name), text)
        archive.writestr(_info(manifest.NAME), manifest.text_of(digests))
    return Packed(path, path.stat().st_size, facts.sizes)


def _info(name: str, mode: int = stat.S_IFREG | 0o644, method: int = ZIP_DEFLATED) -> ZipInfo:
    info = ZipInfo(name, _EPOCH)
    info.create_system = _UNIX
    info.external_attr = mode << 16
    info.compress_type = method
    return info


def _add(archive: ZipFile, file: contents.File, sha256: str) -> None:
    """Add a file; raises InputError if it is no longer of this digest, OSError if there is no room."""
    about = file.source.stat()
    info = _info(file.path, stat.S_IFREG | (0o755 if about.st_mode & stat.S_IXUSR else 0o644))
    info.file_size = about.st_size  # so that zipfile takes 64 bits where they are needed
    digest = hashlib.sha256()
    with file.source.open("rb") as source, archive.open(info, "w") as member:
        while block := source.read(AT_ONCE):
            digest.update(block)
            member.write(block)
    if digest.hexdigest() != sha256:
        raise InputError(f"{file.path}: was changed while it was packed; wait until its study is done")
