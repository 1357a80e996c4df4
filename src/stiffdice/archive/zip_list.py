"""What a zip file from elsewhere says that it holds, checked before anything is unpacked.

What a zip file says twice, in its list at the end and before each member, may be said differently to different readers.
So it is read strictly, not leniently: every byte of the file belongs to exactly one member, to the list or to its end,
and both sayings must agree (PKWARE, APPNOTE.TXT 6.3.10, sections 4.3 to 4.5). Members lie one after another without a
gap, so that they cannot overlap (Fifield 2019, "A better zip bomb", USENIX WOOT).
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import stat
import struct
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple

from stiffdice.errors import InputError, RefusedError, printable


class Limits(NamedTuple):
    """What an archive may hold at most: bytes unpacked, members, and bytes unpacked for one packed.

    ratio: of members above a megabyte. Deflate cannot do more than 1032; what we pack reaches 30. folders: in all, also
    those that are only in names; ours have some dozens. depth: parts of a name; ours have up to 6.
    """

    size: int = 20_000_000_000
    members: int = 1_000_000
    ratio: int = 200
    folders: int = 10_000
    depth: int = 20


LIMITS = Limits()

_SMALL = 1_000_000  # bytes that a member may come to, whatever its ratio
_LONGEST_NAME, _LONGEST_PART = 1024, 255  # bytes

_END = struct.Struct("<4s4H2LH")
_END_64 = struct.Struct("<4sQ2H2L4Q")
_LOCATOR = struct.Struct("<4sLQL")
_ENTRY = struct.Struct("<4s4B4H3L5H2L")
_HEADER = struct.Struct("<4s5H3L2H")
_FULL_16, _FULL_32 = 0xFFFF, 0xFFFFFFFF  # "see the zip64 field"

STORED, _DEFLATED = 0, 8
_ENCRYPTED, _DESCRIBED_AFTER, _UTF_8 = 1 << 0, 1 << 3, 1 << 11
# Of the flags, those that change nothing in how a member is read: speed of compression, and the two above.
_HARMLESS = (1 << 1) | (1 << 2) | _DESCRIBED_AFTER | _UTF_8
_ZIP64_FIELD, _OTHER_NAME_FIELD = 0x0001, 0x7075
_DOS_FOLDER = 0x10


@dataclass(frozen=True)
class Member:
    """A file or folder in a zip file.

    name: with / between its parts; a folder's has none at its end. size, packed: bytes unpacked and in the zip file.
    start: where its data begin in the zip file.
    """

    name: str
    is_folder: bool
    is_program: bool
    size: int
    packed: int
    checksum: int
    method: int
    flags: int
    header: int
    start: int = -1


def members(path: str | Path, limits: Limits = LIMITS) -> list[Member]:
    """Return what a zip file holds, in the order in which it lies there, without unpacking any of it.

    Raises RefusedError naming the file, the member and what is wrong with it, InputError if it cannot be read.
    """
    with _told(path), Path(path).open("rb") as file:
        length = os.fstat(file.fileno()).st_size
        list_start, list_length, count = _end(file, length)
        if count > limits.members:
            raise RefusedError(f"{count} members; allowed are {limits.members}")
        listed = list(_listed(file, list_start, list_length, count))
        _check_names(listed, limits)
        _check_sizes(listed, limits)
        return _located(file, listed, list_start)


@contextlib.contextmanager
def _told(path: str | Path) -> Iterator[None]:
    """Say with the file's name what is wrong with it."""
    try:
        yield
    except InputError as error:
        raise error.within(str(path)) from None
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None


def _read(file: BinaryIO, start: int, length: int, what: str) -> bytes:
    if start < 0:
        raise RefusedError(f"not a zip file, or cut short: {what} is missing")
    file.seek(start)
    data = file.read(length)
    if len(data) != length:
        raise RefusedError(f"cut short: {what} is missing")
    return data


def _end(file: BinaryIO, length: int) -> tuple[int, int, int]:
    """Return where the list of members begins, how long it is, and how many it lists."""
    at = length - _END.size
    signature, disk, list_disk, here, count, size, start, comment = _END.unpack(_read(file, at, _END.size, "its end"))
    if signature != b"PK\5\6" or comment != 0:
        raise RefusedError("not a zip file, or cut short, or with something after its end")
    if _FULL_16 in (disk, list_disk, here, count) or _FULL_32 in (size, start):
        locator_at = at - _LOCATOR.size
        at = locator_at - _END_64.size
        signature, first, told_at, disks = _LOCATOR.unpack(_read(file, locator_at, _LOCATOR.size, "its end"))
        if signature != b"PK\6\7" or (first, told_at, disks) != (0, at, 1):
            raise RefusedError("its end is not where it says")
        signature, rest, _, _, disk, list_disk, here, count, size, start = _END_64.unpack(
            _read(file, at, _END_64.size, "its end")
        )
        if signature != b"PK\6\6" or rest != _END_64.size - 12:
            raise RefusedError("its end is not where it says")
    if (disk, list_disk) != (0, 0) or here != count:
        raise RefusedError("is a part of a zip file of several parts")
    if start + size != at or count * _ENTRY.size > size:
        raise RefusedError("its list of members is not where it says")
    return start, size, count


def _listed(file: BinaryIO, start: int, length: int, count: int) -> Iterator[Member]:
    """Yield what the list of members says of each."""
    at, end = start, start + length
    for _ in range(count):
        fields = _ENTRY.unpack(_read(file, at, _ENTRY.size, "its list of members"))
        name_length, extra_length, comment_length = fields[12:15]
        at += _ENTRY.size + name_length + extra_length + comment_length
        if fields[0] != b"PK\1\2" or at > end:
            raise RefusedError("its list of members is damaged")
        rest = _read(file, at - name_length - extra_length - comment_length, name_length + extra_length, "a name")
        yield _member(fields, rest[:name_length], rest[name_length:])
    if at != end:
        raise RefusedError("its list of members has more in it than it says")


def _member(fields: tuple[int, ...], raw_name: bytes, extra: bytes) -> Member:
    """Return a member as its entry in the list says; the fields are those of _ENTRY."""
    flags, method, checksum, packed, size = fields[5], fields[6], fields[9], fields[10], fields[11]
    disk, attributes, header = fields[15], fields[17], fields[18]
    name = _name_of(raw_name, flags)
    blocks = _blocks(name, extra)
    if _OTHER_NAME_FIELD in blocks:
        raise RefusedError(f"{name}: has a second name")
    wide = _Wide(name, blocks.get(_ZIP64_FIELD, b""))
    size, packed, header = wide.value(size), wide.value(packed), wide.value(header)
    if disk != 0:
        raise RefusedError(f"{name}: is in another part of the zip file")
    if flags & _ENCRYPTED:
        raise RefusedError(f"{name}: is encrypted")
    if flags & ~_HARMLESS:
        raise RefusedError(f"{name}: flags {flags:#06x} ask for what is not known here")
    if method not in {STORED, _DEFLATED}:
        raise RefusedError(f"{name}: compression {method}; allowed are none (0) and deflate (8)")
    is_folder = name.endswith("/")
    mode = attributes >> 16
    kind = stat.S_IFMT(mode)
    if kind not in {0, stat.S_IFDIR if is_folder else stat.S_IFREG} or bool(attributes & _DOS_FOLDER) > is_folder:
        raise RefusedError(f"{name}: is {_KINDS.get(kind, 'of a special kind')}; allowed are files and folders")
    if is_folder and (size, checksum) != (0, 0):
        raise RefusedError(f"{name}: a folder with content")
    if method == STORED and packed != size:
        raise RefusedError(f"{name}: not compressed, but {packed} bytes for {size}")
    is_program = not is_folder and bool(mode & stat.S_IXUSR)
    return Member(name.removesuffix("/"), is_folder, is_program, size, packed, checksum, method, flags, header)


_KINDS = {
    stat.S_IFLNK: "a link",
    stat.S_IFDIR: "a folder with the name of a file",
    stat.S_IFREG: "a file with the name of a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    0: "a folder with the name of a file",
}


def _blocks(name: str, extra: bytes) -> dict[int, bytes]:
    """Return the extra fields of an entry by their number."""
    blocks: dict[int, bytes] = {}
    at = 0
    while at + 4 <= len(extra):
        number, length = struct.unpack_from("<2H", extra, at)
        at += 4 + length
        if number in blocks or at > len(extra):
            break
        blocks[number] = extra[at - length : at]
    if at != len(extra):
        raise RefusedError(f"{name}: its extra fields are damaged")
    return blocks


class _Wide:
    """The numbers of an entry that need more than 32 bits: in the zip64 field, in order, those that are asked for."""

    def __init__(self, name: str, data: bytes) -> None:
        self._name, self._data = name, data

    def value(self, narrow: int) -> int:
        """Return a number of the entry, the next of the zip64 field if the entry says to look there."""
        if narrow != _FULL_32:
            return narrow
        if len(self._data) < 8:
            raise RefusedError(f"{self._name}: its size is missing")
        wide, self._data = int.from_bytes(self._data[:8], "little"), self._data[8:]
        return wide


def _name_of(raw: bytes, flags: int) -> str:
    """Return the name of a member, checked; raises RefusedError naming it."""
    try:
        name = raw.decode("utf-8" if flags & _UTF_8 else "ascii")
    except UnicodeDecodeError:
        raise RefusedError(f"{raw!r}: a name that is not UTF-8") from None
    shown = printable(name)
    if len(raw) > _LONGEST_NAME:
        raise RefusedError(f"{shown[:80]}...: a name of {len(raw)} bytes; allowed are {_LONGEST_NAME}")
    if not name.isprintable():  # control characters, NUL, and what turns the direction of text around
        raise RefusedError(f"{shown}: a name with a character that is not printed")
    if name.startswith("/"):
        raise RefusedError(f"{shown}: an absolute path")
    if "\\" in name or ":" in name:
        raise RefusedError(f"{shown}: a name with a backslash or a colon, which some systems take for a path")
    for part in name.removesuffix("/").split("/"):
        if part == "..":
            raise RefusedError(f"{shown}: a path that climbs out")
        if part in {"", "."} or part.strip(" ") != part or part.endswith("."):
            raise RefusedError(f"{shown}: a path with a part {part!r}, which some systems take for another")
        if len(part.encode()) > _LONGEST_PART:
            raise RefusedError(f"{shown[:80]}...: a path with a part longer than {_LONGEST_PART} bytes")
    return name


def _check_names(listed: list[Member], limits: Limits) -> None:
    """Raise RefusedError if two names are one file somewhere: in any case, in any form of Unicode, or as a folder.

    Also if they lie too deep, or in too many folders.
    """
    files: dict[str, str] = {}
    folders: dict[str, str] = {}
    for member in listed:
        parts = member.name.split("/")
        if len(parts) > limits.depth:
            raise RefusedError(f"{member.name[:80]}...: {len(parts)} parts in a name; allowed are {limits.depth}")
        above = ["/".join(parts[:depth]) for depth in range(1, len(parts))]
        for folder in [*above, *([member.name] if member.is_folder else [])]:
            if folders.setdefault(_folded(folder), folder) != folder:
                raise RefusedError(f"{folder}: a name that some systems take for {folders[_folded(folder)]}")
        if len(folders) > limits.folders:
            raise RefusedError(f"more than {limits.folders} folders; this is no archive of a study")
        if member.is_folder:
            continue
        if _folded(member.name) in files:
            other = files[_folded(member.name)]
            twice = "is there twice" if other == member.name else f"a name that some systems take for {other}"
            raise RefusedError(f"{member.name}: {twice}")
        files[_folded(member.name)] = member.name
    for name in files.keys() & folders.keys():
        raise RefusedError(f"{files[name]}: is a file and a folder")


def _folded(name: str) -> str:
    """Return what names have in common that a file system may take for one."""
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", name).casefold())


def _check_sizes(listed: list[Member], limits: Limits) -> None:
    total = 0
    for member in listed:
        total += member.size
        if total > limits.size:
            raise RefusedError(f"more than {limits.size} bytes unpacked; this is no archive of a study")
        if member.size > max(_SMALL, limits.ratio * member.packed):
            raise RefusedError(
                f"{member.name}: {member.size} bytes out of {member.packed}; allowed are {limits.ratio} for one"
            )


def _located(file: BinaryIO, listed: list[Member], end: int) -> list[Member]:
    """Return the members with the places of their data, if they fill the file up to its list without a gap."""
    ordered = sorted(listed, key=lambda member: member.header)
    located: list[Member] = []
    at = 0
    for member in ordered:
        if member.header != at:
            reason = "overlaps another member" if member.header < at else "has something before it that is no member"
            raise RefusedError(f"{member.name}: {reason}")
        start = at + _header_length(file, member)
        at = start + member.packed
        if member.flags & _DESCRIBED_AFTER:
            at += _descriptor_length(file, member, at)
        if at > end:
            raise RefusedError(f"{member.name}: reaches into the list of members")
        located.append(dataclasses.replace(member, start=start))
    if at != end:
        raise RefusedError("has something between its members and their list")
    return located


def _header_length(file: BinaryIO, member: Member) -> int:
    """Return the length of what is before a member's data, if it says of it what the list says."""
    fields = _HEADER.unpack(_read(file, member.header, _HEADER.size, f"{member.name}"))
    signature, _, flags, method, _, _, checksum, packed, size, name_length, extra_length = fields
    if signature != b"PK\3\4":
        raise RefusedError(f"{member.name}: is not where the list of members says")
    rest = _read(file, member.header + _HEADER.size, name_length + extra_length, f"{member.name}")
    blocks = _blocks(member.name, rest[name_length:])
    told = member.name + ("/" if member.is_folder else "")
    if (
        rest[:name_length] != told.encode()
        or _OTHER_NAME_FIELD in blocks
        or (flags, method)
        != (
            member.flags,
            member.method,
        )
    ):
        raise RefusedError(f"{member.name}: the list of members says otherwise than the member itself")
    wide = _Wide(member.name, blocks.get(_ZIP64_FIELD, b""))
    said = checksum, wide.value(size), wide.value(packed)
    later = bool(flags & _DESCRIBED_AFTER) and said == (0, 0, 0)
    if not later and said != (member.checksum, member.size, member.packed):
        raise RefusedError(f"{member.name}: the list of members says otherwise than the member itself")
    return _HEADER.size + name_length + extra_length


def _descriptor_length(file: BinaryIO, member: Member, at: int) -> int:
    """Return the length of what says after a member's data how long they are, if that is what the list says."""
    for signature in (b"PK\7\x08", b""):
        for form in ("<3L", "<L2Q"):
            length = len(signature) + struct.calcsize(form)
            narrow = form == "<3L" and max(member.packed, member.size) > _FULL_32
            if narrow:
                continue
            file.seek(at)
            if file.read(length) == signature + struct.pack(form, member.checksum, member.packed, member.size):
                return length
    raise RefusedError(f"{member.name}: the list of members says otherwise than the member itself")
