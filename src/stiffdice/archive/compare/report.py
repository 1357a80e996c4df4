"""What a comparison found, for people and for programs."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from stiffdice.archive.compare.datasets import Aspect, Difference
from stiffdice.archive.compare.values import Values
from stiffdice.errors import printable
from stiffdice.io.content_digest import Plain

# Of files, of attributes, and of variables of one file: so many are shown to people.
SHOWN = 20
_WIDE = 40  # characters of a text that are shown


@dataclass(frozen=True)
class Comparison:
    """What differs between A and B.

    differences: of the files that both have and that are not the same. only_a, only_b: files that one has. left_out:
    side files. files: how many were compared, identical: how many of them byte for byte the same. single: whether A
    and B are files, not folders.
    """

    differences: tuple[Difference, ...] = ()
    only_a: tuple[str, ...] = ()
    only_b: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    files: int = 0
    identical: int = 0
    single: bool = False

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
        lines = [self.verdict, *self._about_attributes()]
        for side, names in (("A", self.only_a), ("B", self.only_b)):
            lines += _first(f"only in {side}: {{}}".format, names, "files")
        for part in self.differences[:SHOWN]:
            about = list(_about(part))
            if self.single:
                lines += about
            elif about:
                lines += ["", part.name, *(f"  {line}" for line in about)]
        lines += _more(len(self.differences) - SHOWN, "files")
        if self.left_out:
            left_out = _count(len(self.left_out), "file")
            lines += ["", f"left out: {left_out} of logs, times and the like; --all takes them"]
        return [printable(line) for line in lines]

    @property
    def verdict(self) -> str:
        """Whether A and B differ, in one line."""
        if not self.same:
            different = f"different: {', '.join(self._how_different())}"
            return f"the numbers are the same; {different}" if self.numbers_same else different
        if self.identical == self.files:
            return "the same, byte for byte" + ("" if self.single else f": {_count(self.files, 'file')}")
        how = "" if self.single else f": {_count(self.files, 'file')}, {self.identical} of them byte for byte"
        return f"the same numbers and attributes, stored otherwise{how}"

    def _how_different(self) -> Iterator[str]:
        """Yield what differs, the gravest first."""
        parts = self.differences
        unreadable = sum(len(part.unreadable) for part in parts)
        if unreadable:
            yield f"{_count(unreadable, 'file')} that cannot be read"
        if any(part.values for part in parts):
            yield self._in("numbers", (part.values for part in parts)) + _up_to(parts)
        for side, cells in (("A", [part.only_a for part in parts]), ("B", [part.only_b for part in parts])):
            if any(cells):
                yield f"{_count(sum(map(len, cells)), 'cell')} only in {side}"
        if any(part.shapes for part in parts):
            yield self._in("variables, types or sizes", (part.shapes for part in parts))
        if any(part.attributes for part in parts):
            yield self._in("attributes", (part.attributes for part in parts))
        others = sum(part.other for part in parts)
        if others:
            yield _count(others, "other file")
        for side, names in (("A", self.only_a), ("B", self.only_b)):
            if names:
                yield f"{_count(len(names), 'file')} only in {side}"

    def _in(self, what: str, found: Iterable[Sequence[object]]) -> str:
        return what if self.single else f"{what} in {_count(sum(map(bool, found)), 'file')}"

    def _about_attributes(self) -> list[str]:
        """Return which attributes differ, each once for all files that it does in: what made them explains the rest."""
        found = Counter(aspect for part in self.differences for aspect in part.attributes)
        # What only one of the two says is often only newer.
        ordered = sorted(found, key=lambda aspect: (None in (aspect.a, aspect.b), -found[aspect]))
        return _first(
            lambda one: f"{one.name}: {_against(one)}" + ("" if self.single else f" ({_count(found[one], 'file')})"),
            ordered,
            "attributes",
        )

    def as_json(self) -> str:
        """Return all of it as JSON, with text for the numbers that JSON does not have."""
        content = asdict(self) | {"verdict": self.verdict, "same": self.same, "numbers_same": self.numbers_same}
        return json.dumps(json.loads(json.dumps(content), parse_constant=lambda name: repr(float(name))), indent=2)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _more(number: int, what: str) -> list[str]:
    return [f"… and {number} more {what}"] if number > 0 else []


def _first(shown: Callable[[Any], str], found: Sequence[Any], what: str) -> list[str]:
    return [*map(shown, found[:SHOWN]), *_more(len(found) - SHOWN, what)]


def _up_to(parts: Sequence[Difference]) -> str:
    """Return the largest difference of floats in all files."""
    values = [one for part in parts for one in part.values if one.ulp is not None]
    if not values:
        return ""
    share = max(one.relative or 0.0 for one in values)
    return f" (up to {_many(max(one.ulp or 0 for one in values))} ulp, {share:.2g} of the value)"


def _many(number: float) -> str:
    """Return a whole number as people read it."""
    return str(number) if number < 1_000_000 else f"{number:.2g}"


def _about(part: Difference) -> Iterator[str]:
    """Yield how the files of one name differ, line by line."""
    yield from part.unreadable
    for side, cells in (("A", part.only_a), ("B", part.only_b)):
        if cells:
            yield f"only in {side}: {_count(len(cells), 'cell')}, {cells[0]}" + (", …" if len(cells) > 1 else "")
    for values in part.values[:SHOWN]:
        yield from _about_values(values)
    yield from _more(len(part.values) - SHOWN, "variables")
    yield from _first(lambda aspect: f"{aspect.name}: {_against(aspect)}", part.shapes, "variables")
    if part.other:
        yield "other bytes"
    yield from part.notes


def _about_values(values: Values) -> Iterator[str]:
    units = "" if values.units == "1" else f" {values.units}"
    sizes = [
        *([] if values.ulp is None else [f"{_many(values.ulp)} ulp"]),
        *([] if values.relative is None else [f"{values.relative:.2g} of the value"]),
        *([] if values.absolute is None else [f"{values.absolute:.3g}{units}"]),
    ]
    if values.of == 1:
        place = values.places[0]
        yield f"{values.variable}: {', '.join([f'{place.a} against {place.b}', *sizes])}"
        return
    size = f", by up to {', '.join(sizes)}" if sizes else ""
    unmeasured = f" ({values.unmeasured} NaN or infinite)" if values.unmeasured else ""
    yield f"{values.variable}: {values.count} of {_count(values.of, 'value')} differ{size}{unmeasured}"
    yield from _first("  {}".format, values.changes, "changes")
    for place in values.places:
        index = f" [{', '.join(map(str, place.index))}]" if place.index else ""
        yield f"  {place.where}{index}: {place.a} against {place.b}"


def _against(aspect: Aspect) -> str:
    """Return two values shortly."""
    if aspect.a is None or aspect.b is None:
        return f"only in {'B' if aspect.a is None else 'A'}: {_short(aspect.b if aspect.a is None else aspect.a)}"
    return f"{_short(aspect.a)} against {_short(aspect.b)}"


def _short(value: Plain | None) -> str:
    text = str(value)
    return text if len(text) <= _WIDE else f"{text[: _WIDE - 1]}…"
