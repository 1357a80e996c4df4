"""How much room an archive takes: by kind of file, and by run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple
from zipfile import ZipInfo

MANY = 1_000_000  # runs of a study that sizes are stated for


class Size(NamedTuple):
    """So many files; bytes of them unpacked, and packed."""

    files: int
    bytes: int
    packed: int

    @classmethod
    def of(cls, members: Iterable[ZipInfo]) -> Size:
        """Return the size of members of a zip file together."""
        each = [(member.file_size, member.compress_size) for member in members]
        return cls(len(each), sum(size for size, _ in each), sum(packed for _, packed in each))


class Sizes(NamedTuple):
    """What an archive holds, without the three files that describe it.

    kinds: by the name of the kind, those there are, and `all`. runs: how many runs of sweeps; shards: the files that
    hold them.
    """

    kinds: Mapping[str, Size]
    runs: int
    shards: Size

    @property
    def per_run(self) -> tuple[float, float] | None:
        """Bytes of shards for one run, unpacked and packed; None if there are no runs."""
        return (self.shards.bytes / self.runs, self.shards.packed / self.runs) if self.runs else None

    @property
    def sentence(self) -> str:
        """What a run takes, and what a million would; empty if the study has no sweep."""
        if self.per_run is None:
            return ""
        each, packed = self.per_run
        return (
            f"{self.runs:,} runs in {self.shards.files} shards: {each:.1f} bytes a run, {packed:.1f} packed; "
            f"a million such runs: {in_megabytes(each * MANY)}, {in_megabytes(packed * MANY)} packed"
        )

    def as_data(self) -> dict[str, object]:
        """Return it for programs."""
        each, packed = self.per_run or (None, None)
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
