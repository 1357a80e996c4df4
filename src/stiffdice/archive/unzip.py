"""A zip file from elsewhere, unpacked into a folder: all of it, only it, and nothing anywhere else."""

from __future__ import annotations

import os
import shutil
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

from stiffdice.archive.zip_list import LIMITS, STORED, Limits, Member, members
from stiffdice.errors import OutputError, RefusedError

AT_ONCE = 1 << 20  # bytes in memory at a time, of what is packed and of what comes out


def unzip(
    path: str | Path,
    folder: str | Path,
    tell: Callable[[float], None] | None = None,
    *,
    damaged: dict[str, str] | None = None,
    limits: Limits = LIMITS,
) -> None:
    """Unpack a zip file that nobody vouches for into a new or empty folder, all of it or nothing.

    tell: called with the fraction done. damaged: members whose content is not what it was are left out and noted here,
    with the reason; without it, the first of them ends it. Raises RefusedError naming the file, the member and what is
    wrong with it, InputError if it cannot be read or the folder is not empty, OutputError if there is no room.
    """
    target, found = Path(folder), members(path, limits)
    _check_target(target, sum(member.size for member in found))
    temporary = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        temporary.mkdir()
        with Path(path).open("rb") as file:
            done, total = 0, 1 + sum(member.packed for member in found)
            for member in found:
                try:
                    _unpack(file, member, temporary)
                except _DamagedError as error:
                    if damaged is None:
                        raise RefusedError(f"{path}: {member.name}: {error}") from None
                    damaged[member.name] = str(error)
                done += member.packed
                if tell is not None:
                    tell(done / total)
        temporary.replace(target)
    except OSError as error:
        raise OutputError(f"{target}: {error.strerror}; nothing was unpacked") from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _check_target(target: Path, size: int) -> None:
    if not target.parent.is_dir():
        raise OutputError(f"{target}: the folder {target.parent} does not exist")
    if target.is_symlink() or (target.exists() and not target.is_dir()):
        raise OutputError(f"{target}: is there and not a folder")
    if target.is_dir() and any(target.iterdir()):
        raise OutputError(f"{target}: is not empty; name a new folder")
    free = shutil.disk_usage(target.parent).free
    if size > free:
        raise OutputError(f"{target}: needs {size} bytes of disk, {free} are free; nothing was unpacked")


class _DamagedError(Exception):
    """A member whose content is not what it was."""


def _unpack(file: BinaryIO, member: Member, folder: Path) -> None:
    """Unpack one member; raises _DamagedError, and leaves no file, if its content is damaged."""
    path = folder / member.name
    if member.is_folder:
        path.mkdir(parents=True, exist_ok=True)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    checksum = 0
    try:
        # Not through anything that is there; every folder above is one that we made.
        with path.open("xb") as out:
            left = member.size
            for block in _content(file, member):
                left -= len(block)
                if left < 0:
                    raise _DamagedError(f"holds more than the {member.size} bytes that it says")
                checksum = zlib.crc32(block, checksum)
                out.write(block)
        if left > 0:
            raise _DamagedError(f"damaged: {member.size - left} bytes instead of {member.size}")
        if checksum != member.checksum:
            raise _DamagedError(f"damaged: its checksum is {checksum:08x} instead of {member.checksum:08x}")
    except _DamagedError:
        path.unlink()
        raise
    if member.is_program:
        path.chmod(path.stat().st_mode | ((path.stat().st_mode & 0o444) >> 2))


def _content(file: BinaryIO, member: Member) -> Iterator[bytes]:
    """Yield what a member holds in blocks of at most AT_ONCE bytes; raises _DamagedError where it cannot be read."""
    file.seek(member.start)
    if member.method == STORED:
        yield from _packed(file, member)
        return
    stream = zlib.decompressobj(-zlib.MAX_WBITS)
    try:
        for packed in _packed(file, member):
            if stream.eof:
                raise _DamagedError("damaged: goes on after its end")
            yield stream.decompress(packed, AT_ONCE)
            while stream.unconsumed_tail:
                yield stream.decompress(stream.unconsumed_tail, AT_ONCE)
        while not stream.eof:  # what zlib still holds of the last block
            rest = stream.decompress(b"", AT_ONCE)
            if not rest:
                break
            yield rest
    except zlib.error as error:
        raise _DamagedError(f"damaged: {str(error).split(': ')[-1]}") from None
    if not stream.eof or stream.unused_data:
        raise _DamagedError("damaged: its end is not where it says")


def _packed(file: BinaryIO, member: Member) -> Iterator[bytes]:
    left = member.packed
    while left > 0:
        block = file.read(min(AT_ONCE, left))
        if not block:
            raise _DamagedError("damaged: cut short")
        left -= len(block)
        yield block
