"""How much room an archive takes: by kind of file, and by run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from stiffdice.archive.contents import KINDS

# A study of so many runs is what sizes are stated for.
MANY = 1_000_000


class Size(NamedTuple):
    """So many files; bytes of them unpacked, and packed."""

    files: int = 0
    bytes: int = 0
    packed: int = 0

    def __add__(self, other: object) -> Size:
        assert isinstance(other, Size)
        return Size(self.files + other.files, self.bytes + other.bytes, self.packed + other.packed)


class Sizes(NamedTuple):
    """What an archive holds, without the three files that describe it.

    kinds: by the name of the kind, those there are. runs: how many runs of sweeps; shards: the files that hold them.
    """

    kinds: Mapping[str, Size]
    runs: int
    shards: Size

    @property
    def total(self) -> Size:
        """All kinds together."""
        return sum_of(self.kinds.values())

    def per_run(self, packed: bool = False) -> float:
        """Return how many bytes of shards there are for one run; NaN if there are no runs."""
        return (self.shards.packed if packed else self.shards.bytes) / self.runs if self.runs else float("nan")


def sum_of(sizes: Iterable[Size]) -> Size:
    """Return sizes together."""
    total = Size()
    for size in sizes:
        total += size
    return total


def rows(sizes: Sizes) -> list[tuple[str, Size]]:
    """Return the lines of a table: every kind by its name for people, then all of them."""
    kinds = [(KINDS[kind], sizes.kinds[kind]) for kind in KINDS if kind in sizes.kinds]
    return [*kinds, ("all", sizes.total)]


def sentence(sizes: Sizes) -> str:
    """Return what a run takes, and what a million would; empty if the study has no sweep."""
    if not sizes.runs:
        return ""
    bytes_each, packed_each = sizes.per_run(), sizes.per_run(packed=True)
    return (
        f"{sizes.runs:,} runs in {sizes.shards.files} shards: {bytes_each:.1f} bytes a run, {packed_each:.1f} packed; "
        f"a million such runs: {in_megabytes(bytes_each * MANY)}, {in_megabytes(packed_each * MANY)} packed"
    )


def in_megabytes(size: float) -> str:
    """Return a number of bytes for people."""
    return f"{size / 1e6:.1f} MB" if size >= 1e5 else f"{size / 1e3:.1f} kB"


def text_of(sizes: Sizes) -> str:
    """Return the sizes as lines of text."""
    lines = [f"{'':22}{'files':>6}{'unpacked':>12}{'packed':>12}"]
    lines += [
        f"{name:22}{size.files:6}{in_megabytes(size.bytes):>12}{in_megabytes(size.packed):>12}"
        for name, size in rows(sizes)
    ]
    return "\n".join([*lines, *([sentence(sizes)] if sizes.runs else [])])
