"""What a comparison found, for people and for programs."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass

from stiffdice.archive.compare.differences import Aspect, Difference, Values
from stiffdice.errors import printable

# Of files, of attributes, and of variables of one file: so many are shown to people.
SHOWN = 20
_WIDE = 40  # characters of a text that are shown

# What of files of one name may differ, by the field that says so; the gravest first.
_KINDS = {
    "unreadable": "data that cannot be read",
    "values": "numbers",
    "only_a": "cells only in A",
    "only_b": "cells only in B",
    "shapes": "variables, types or sizes",
    "attributes": "attributes",
    "other": "other bytes",
}


@dataclass(frozen=True)
class Comparison:
    """What differs between A and B.

    differences: of the files that both have and that are not the same. only_a, only_b: files that one has. left_out:
    side files. files: how many were compared, identical: how many of them byte for byte the same.
    """

    differences: tuple[Difference, ...] = ()
    only_a: tuple[str, ...] = ()
    only_b: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    files: int = 0
    identical: int = 0

    @property
    def same(self) -> bool:
        """Whether A and B say the same, however it is stored, side files aside."""
        return not (self.differences or self.only_a or self.only_b)

    @property
    def numbers_same(self) -> bool:
        """Whether all data are there in both, and their values are equal, bit by bit, whatever else differs."""
        alone = any(name.endswith(".h5") for name in (*self.only_a, *self.only_b))
        return not (alone or any(part.numbers for part in self.differences))

    def lines(self) -> list[str]:
        """Return what differs as text: the verdict, what explains it, then file by file, as much as one can read."""
        found = Counter(aspect for part in self.differences for aspect in part.attributes)
        # What made them explains the rest; what only one of the two says is often only newer.
        ordered = sorted(found.items(), key=lambda item: (None in (item[0].a, item[0].b), -item[1]))
        lines = [self.verdict]
        lines += _first([f"{_against(one)} ({_count(count, 'file')})" for one, count in ordered], "attributes")
        for side, names in (("A", self.only_a), ("B", self.only_b)):
            lines += _first([f"only in {side}: {name}" for name in names], "files")
        for part in self.differences[:SHOWN]:
            if about := list(_about(part)):
                lines += ["", part.name, *(f"  {line}" for line in about)]
        lines += _more(len(self.differences) - SHOWN, "files")
        if self.left_out:
            left_out = _count(len(self.left_out), "file")
            lines += ["", f"left out: {left_out} of logs, times and the like; --all takes them"]
        return [printable(line) for line in lines]

    @property
    def verdict(self) -> str:
        """Whether A and B differ, in one line."""
        files = _count(self.files, "file")
        if self.same and self.identical == self.files:
            return f"the same, byte for byte: {files}"
        if self.same:
            return f"the same numbers and attributes, stored otherwise: {files}, {self.identical} of them byte for byte"
        how = []
        for field, what in _KINDS.items():
            if number := sum(bool(getattr(part, field)) for part in self.differences):
                how.append(f"{what} in {_count(number, 'file')}{_up_to(self.differences) if field == 'values' else ''}")
        for side, names in (("A", self.only_a), ("B", self.only_b)):
            how += [f"{_count(len(names), 'file')} only in {side}"] if names else []
        return f"{'the numbers are the same; ' if self.numbers_same else ''}different: {', '.join(how)}"

    def as_json(self) -> str:
        """Return all of it as JSON, with text for the numbers that JSON does not have."""
        content = asdict(self) | {"verdict": self.verdict, "same": self.same, "numbers_same": self.numbers_same}
        return json.dumps(json.loads(json.dumps(content), parse_constant=lambda name: repr(float(name))), indent=2)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _more(number: int, what: str) -> list[str]:
    return [f"… and {number} more {what}"] if number > 0 else []


def _first(lines: Sequence[str], what: str) -> list[str]:
    return [*lines[:SHOWN], *_more(len(lines) - SHOWN, what)]


def _up_to(parts: Sequence[Difference]) -> str:
    """Return the largest difference of floats in all files."""
    sizes = [(one.ulp, one.relative or 0.0) for part in parts for one in part.values if one.ulp is not None]
    return f" (up to {_relative(*map(max, zip(*sizes, strict=True)))})" if sizes else ""


def _relative(ulp: int, relative: float | None) -> str:
    number = str(ulp) if ulp < 1_000_000 else f"{ulp:.2g}"
    return f"{number} ulp, {relative:.2g} of the value"


def _about(part: Difference) -> Iterator[str]:
    """Yield how the files of one name differ, line by line."""
    yield from part.unreadable
    for side, cells in (("A", part.only_a), ("B", part.only_b)):
        if cells:
            yield f"only in {side}: {_count(len(cells), 'cell')}, {cells[0]}" + (", …" if len(cells) > 1 else "")
    for values in part.values[:SHOWN]:
        yield from _about_values(values)
    yield from _more(len(part.values) - SHOWN, "variables")
    yield from _first(list(map(_against, part.shapes)), "variables")
    if part.other:
        yield _KINDS["other"]
    yield from part.notes


def _about_values(values: Values) -> Iterator[str]:
    sizes = [] if values.ulp is None else [_relative(values.ulp, values.relative)]
    if values.absolute is not None:
        sizes.append(f"{values.absolute:.3g}" + ("" if values.units == "1" else f" {values.units}"))
    if values.of == 1:
        yield ", ".join([f"{values.variable}: {values.places[0].a} against {values.places[0].b}", *sizes])
        return
    size = f", by up to {', '.join(sizes)}" if sizes else ""
    unmeasured = f" ({values.unmeasured} NaN or infinite)" if values.unmeasured else ""
    yield f"{values.variable}: {values.count} of {_count(values.of, 'value')} differ{size}{unmeasured}"
    yield from _first([f"  {change}" for change in values.changes], "changes")
    for place in values.places:
        yield f"  {place.where}: {place.a} against {place.b}"


def _against(aspect: Aspect) -> str:
    """Return what two files say, shortly."""
    a, b = (text if len(text) <= _WIDE else f"{text[: _WIDE - 1]}…" for text in (str(aspect.a), str(aspect.b)))
    if aspect.a is None or aspect.b is None:
        return f"{aspect.name}: only in {'B' if aspect.a is None else 'A'}: {b if aspect.a is None else a}"
    return f"{aspect.name}: {a} against {b}"
