"""Changes of an HDF5 file where its structure is, with the checksums of its blocks made right again.

Without that the library would stop at the first checksum, and what is behind would never be tried.
The blocks are told in the HDF5 file format specification, version 3.0, sections III.A.2, III.G and IV.A.1.b.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterator

from tests.fuzz.mutations import bytes_of

_HALF = 0xFFFFFFFF
_VALUES = (0, 1, 2, 3, 0x7F, 0x80, 0xFE, 0xFF)
_TREE_HEADER, _HEAP_HEADER = 38, 146  # bytes, with their checksums


def lookup3(data: bytes) -> int:
    """Return the checksum of a block: hashlittle of Bob Jenkins's lookup3.c, from 0."""
    a = b = c = (0xDEADBEEF + len(data)) & _HALF
    whole = max(0, (len(data) - 1) // 12) * 12
    for start in range(0, whole, 12):
        a = (a + int.from_bytes(data[start : start + 4], "little")) & _HALF
        b = (b + int.from_bytes(data[start + 4 : start + 8], "little")) & _HALF
        c = (c + int.from_bytes(data[start + 8 : start + 12], "little")) & _HALF
        for turn in ((4, 6, 8), (16, 19, 4)):
            for k, shift in enumerate(turn):
                if k == 0:
                    a = ((a - c) ^ _rotated(c, shift)) & _HALF
                    c = (c + b) & _HALF
                elif k == 1:
                    b = ((b - a) ^ _rotated(a, shift)) & _HALF
                    a = (a + c) & _HALF
                else:
                    c = ((c - b) ^ _rotated(b, shift)) & _HALF
                    b = (b + a) & _HALF
    rest = data[whole:]
    if not rest:
        return c
    a, b, c = ((x + int.from_bytes(rest[k : k + 4], "little")) & _HALF for x, k in ((a, 0), (b, 4), (c, 8)))
    for x, y, shift in (
        ("c", "b", 14),
        ("a", "c", 11),
        ("b", "a", 25),
        ("c", "b", 16),
        ("a", "c", 4),
        ("b", "a", 14),
        ("c", "b", 24),
    ):
        parts = {"a": a, "b": b, "c": c}
        parts[x] = ((parts[x] ^ parts[y]) - _rotated(parts[y], shift)) & _HALF
        a, b, c = parts["a"], parts["b"], parts["c"]
    return c


def _rotated(x: int, shift: int) -> int:
    return (x << shift | x >> 32 - shift) & _HALF


def blocks(image: bytes) -> list[tuple[int, int]]:
    """Return where blocks with a right checksum start, and where their checksum does."""
    return [(start, end) for start, end in _candidates(image) if lookup3(image[start:end]) == _word(image, end)]


def _word(image: bytes, place: int) -> int:
    return int.from_bytes(image[place : place + 4], "little")


def _candidates(image: bytes) -> Iterator[tuple[int, int]]:
    for found in re.finditer(rb"OHDR|OCHK|BTHD|FRHP", image):
        start = found.start()
        if found[0] == b"OHDR":
            flags = image[start + 5]
            size_at = start + 6 + (16 if flags & 0x20 else 0) + (4 if flags & 0x10 else 0)
            width = 1 << (flags & 3)
            yield start, size_at + width + int.from_bytes(image[size_at : size_at + width], "little")
        elif found[0] == b"OCHK":
            told = image.find(start.to_bytes(8, "little"))
            if told >= 0:
                yield start, start + int.from_bytes(image[told + 8 : told + 16], "little") - 4
        else:
            yield start, start + (_TREE_HEADER if found[0] == b"BTHD" else _HEAP_HEADER) - 4


def changed(image: bytes, others: list[bytes], seed: int) -> bytes:
    """Return an HDF5 file (without a seal) with a few changes, mostly in its structure and with right checksums."""
    chance = random.Random(seed)
    if chance.random() < 0.2:
        return bytes_of(image, others, seed)
    data, known = bytearray(image), blocks(image)
    for _ in range(chance.choice((1, 1, 2, 4))):
        if chance.random() < 0.75:
            start, end = chance.choice(known)
            place = chance.randrange(start, end)
        else:  # trees, heaps and what they hold have none
            signs = [found.start() for found in re.finditer(rb"TREE|GCOL|BTLF|FHDB|FSHD|FSSE|FHIB|HEAP", image)]
            place = chance.choice(signs) + chance.randrange(200)
        _change(data, place, chance)
    for start, end in known:
        data[end : end + 4] = lookup3(bytes(data[start:end])).to_bytes(4, "little")
    return bytes(data)


def _change(data: bytearray, place: int, chance: random.Random) -> None:
    place = min(place, len(data) - 9)
    how = chance.randrange(5)
    if how == 0:
        data[place] ^= 1 << chance.randrange(8)
    elif how == 1:
        data[place] = chance.choice(_VALUES)
    elif how == 2:
        data[place] = (data[place] + chance.choice((-1, 1))) % 256
    elif how == 3:
        data[place : place + 8] = chance.choice((0, 2**60, 2**64 - 1, len(data), chance.randrange(len(data)))).to_bytes(
            8, "little"
        )
    else:
        other = chance.randrange(len(data) - 8)
        data[place : place + 8] = data[other : other + 8]
