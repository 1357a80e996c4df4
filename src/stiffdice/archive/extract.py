"""A zip file from elsewhere, unpacked into a folder: all of it, only it, and nothing anywhere else."""

from __future__ import annotations

import re
import shutil
import stat
import struct
import unicodedata
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from zipfile import ZipFile, ZipInfo

from stiffdice.errors import InputError, OutputError, RefusedError

AT_ONCE = 1 << 20  # bytes unpacked at a time
# What zipfile and zlib raise of a damaged file.
_DAMAGED = (zipfile.BadZipFile, zlib.error, struct.error, EOFError, RuntimeError, ValueError, OverflowError)
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_ENCRYPTED = 1 << 0  # of a member's flags
_HEADER = 30  # bytes of a member before its name
_SMALL = 1_000_000  # bytes that a member may come to, whatever its ratio

# What an archive may hold at most.
MOST_BYTES = 20_000_000_000  # unpacked
MOST_MEMBERS = 1_000_000
MOST_RATIO = 200  # bytes for one packed, of members above a megabyte; deflate can do 1032, what we pack reaches 30
MOST_FOLDERS = 10_000  # also those that are only in names; ours have some dozens
MOST_PARTS = 20  # of a name; ours have up to 6


def unzip(path: str | Path, folder: str | Path, damaged: dict[str, str] | None = None) -> None:
    """Unpack a zip file that nobody vouches for into a new folder, all of it or nothing.

    damaged: members whose content is not what it was are left out and noted here, with the reason; without it, the
    first of them ends it. Raises RefusedError naming the file, the member and what is wrong with it, InputError if it
    cannot be read, OutputError if the folder is there or has no room.
    """
    target = Path(folder)
    try:
        archive = ZipFile(path)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except _DAMAGED as error:
        raise RefusedError(f"{path}: not a zip file, or a damaged one ({error})") from None
    with archive, ExitStack() as unfinished:
        try:
            _check(archive.infolist())
        except RefusedError as error:
            raise error.within(str(path)) from None
        try:
            target.mkdir()
            unfinished.callback(shutil.rmtree, target, ignore_errors=True)
            size, free = sum(member.file_size for member in archive.infolist()), shutil.disk_usage(target).free
            if size > free:
                raise OutputError(f"{target}: needs {size} bytes of disk, {free} are free; nothing was unpacked")
            _unpack_all(archive, target, damaged)
        except OSError as error:
            raise OutputError(f"{target}: {error.strerror}; nothing was unpacked") from None
        unfinished.pop_all()


def _check(members: Sequence[ZipInfo]) -> None:
    """Raise RefusedError naming the first member that must not be unpacked, and why."""
    if len(members) > MOST_MEMBERS:
        raise RefusedError(f"{len(members)} members; allowed are {MOST_MEMBERS}")
    check_names([member.orig_filename for member in members])
    end = 0
    for member in sorted(members, key=lambda member: member.header_offset):
        name, method, size, packed = member.filename, member.compress_type, member.file_size, member.compress_size
        kind = stat.S_IFMT(member.external_attr >> 16)
        reasons = {
            "has a second name": name != member.orig_filename,  # some versions of zipfile take it instead
            "is a link or a special file; allowed are files and folders": kind
            not in {0, stat.S_IFDIR if name.endswith("/") else stat.S_IFREG},
            "is encrypted": member.flag_bits & _ENCRYPTED,
            f"compression {method}; allowed are none (0) and deflate (8)": method not in _METHODS,
            f"{size} bytes out of {packed}; allowed are {MOST_RATIO} for one": size > max(_SMALL, MOST_RATIO * packed),
            # Fifield 2019, "A better zip bomb", USENIX WOOT; zipfile sees it from Python 3.11.8, 3.12.2 and 3.13 on.
            "overlaps another member": member.header_offset < end,
        }
        _refuse_first(member.orig_filename, reasons)
        end = member.header_offset + _HEADER + packed
    if sum(member.file_size for member in members) > MOST_BYTES:
        raise RefusedError(f"more than {MOST_BYTES} bytes unpacked; this is no archive of a study")


def _refuse_first(name: str, reasons: Mapping[str, object]) -> None:
    for reason in (reason for reason, holds in reasons.items() if holds):
        raise RefusedError(f"{name[:200]}: {reason}")


def check_names(names: Sequence[str]) -> None:
    """Raise RefusedError for a name that leads elsewhere, and for two that are one file somewhere.

    That is in any case, in any form of Unicode, or as a file and a folder.
    """
    spelt: dict[str, str] = {}  # each path of a file or folder, as a file system may know it and as it is said
    folders: set[str] = set()
    for name in names:
        parts = name.removesuffix("/").split("/")
        reasons = {
            "a name with a character that is not printed": not name.isprintable(),  # also NUL, what turns text
            "an absolute path": name.startswith("/"),
            "a name with a backslash or a colon, which some systems take for a path": "\\" in name or ":" in name,
            "a path that climbs out": ".." in parts,
            "a path that some systems take for another": any(part.strip(" ").rstrip(".") != part for part in parts),
            "a path with an empty part": "" in parts,
            "a path with a part longer than 255 bytes": max(len(part.encode()) for part in parts) > 255,
            f"{len(parts)} parts in a name; allowed are {MOST_PARTS}": len(parts) > MOST_PARTS,
        }
        _refuse_first(name, reasons)
        for path in (name[: found.end()] for found in re.finditer("/|[^/]$", name)):
            if path in folders:
                continue
            folded = unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", path.removesuffix("/")).casefold())
            if folded in spelt:
                twice = path == spelt[folded]
                reason = "is there twice" if twice else f"a name that some systems take for {spelt[folded]}"
                raise RefusedError(f"{path}: {reason}")
            spelt[folded] = path
            if path.endswith("/"):
                folders.add(path)
        if len(folders) > MOST_FOLDERS:
            raise RefusedError(f"more than {MOST_FOLDERS} folders; this is no archive of a study")


def _unpack_all(archive: ZipFile, folder: Path, damaged: dict[str, str] | None) -> None:
    for member in archive.infolist():
        path = folder / member.filename
        if member.filename.endswith("/"):
            path.mkdir(parents=True, exist_ok=True)
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            # Not through anything that is there; every folder above is one that we made.
            with archive.open(member) as file, path.open("xb") as out:
                shutil.copyfileobj(file, out, AT_ONCE)
                if out.tell() != member.file_size:
                    raise zipfile.BadZipFile(f"{out.tell()} bytes instead of {member.file_size}")
        except _DAMAGED as error:
            path.unlink(missing_ok=True)
            reason = f"damaged: {error or 'cut short'}"
            if damaged is None:
                raise RefusedError(f"{archive.filename}: {member.filename}: {reason}") from None
            damaged[member.filename] = reason
