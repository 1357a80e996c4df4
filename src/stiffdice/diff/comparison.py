"""What a comparison found, for people and for programs."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from stiffdice.diff.description import ATTRIBUTE, DIMENSIONS, VARIABLE, Aspect
from stiffdice.diff.files import Cells, Difference
from stiffdice.diff.folders import SIDE_FILES, SIDE_FOLDERS
from stiffdice.diff.values import Place, Values
from stiffdice.errors import printable
from stiffdice.io.digest import Plain

# Of files, and of variables and attributes of one file: so many are shown to people; of each of many files fewer.
SHOWN, SHOWN_OF_EACH = 20, 4

# What files say of what made them, and what it means if that differs. A name may have others before it
# (`judging_code_digest`), and a key after it (`scene.ground.stiffness`).
ORIGINS = {
    "made by other code": ("code_digest", "stiffdice_version", "simulator", "simulator_version", "formula"),
    "made with other libraries": ("libraries", "versions"),
    "of another scene": ("scene", "scene_digest"),
    "of another configuration": ("config", "config_digest", "seed"),
}


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
    notes: tuple[str, ...] = ()

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
        lines = [self.verdict, *self._origins()]
        lines += [line for title, names in (("A", self.only_a), ("B", self.only_b)) for line in _only(title, names)]
        for part in self.differences[:SHOWN]:
            about = list(_about(part, SHOWN if self.single else SHOWN_OF_EACH))
            if self.single:
                lines += about
            elif about:
                lines += ["", part.name, *(f"  {line}" for line in about)]
        lines += _more(len(self.differences) - SHOWN, "files")
        if self.notes or self.left_out:
            lines.append("")
        lines += self.notes
        if self.left_out:
            lines.append(f"left out: {_by_folder(self.left_out)}; --all compares them, too")
        return [printable(line) for line in lines]

    @property
    def verdict(self) -> str:
        """Whether A and B differ, in one line."""
        if self.same:
            return self._how_same()
        different = list(self._how_different())
        if self.numbers_same:
            return f"the numbers are the same; different: {', '.join(different)}"
        return f"different: {', '.join(different)}"

    def _how_same(self) -> str:
        if self.identical == self.files:
            return "the same, byte for byte" if self.single else f"the same, byte for byte: {self._files()}"
        if self.single:
            return "the same numbers and attributes, stored otherwise"
        how = f"{self.identical} of them byte for byte, the others stored" if self.identical else "all stored"
        return f"the same: {self._files()}, {how} otherwise"

    def _files(self) -> str:
        return _count(self.files, "file")

    def _how_different(self) -> Iterator[str]:
        """Yield what differs, the gravest first."""
        unreadable = sum(len(part.unreadable) for part in self.differences)
        if unreadable:
            yield f"{_count(unreadable, 'file')} that cannot be read"
        valued = [part for part in self.differences if part.values]
        if valued:
            yield f"{self._number_of(valued, 'numbers')}{_up_to(valued)}"
        cells = [part.cells for part in self.differences if part.cells is not None]
        for side, alone in (("A", sum(len(c.only_a) for c in cells)), ("B", sum(len(c.only_b) for c in cells))):
            if alone:
                yield f"{_count(alone, 'cell')} only in {side}"
        shaped = [part for part in self.differences if any(one.what != ATTRIBUTE for one in part.aspects)]
        if shaped:
            yield self._number_of(shaped, "variables, types or sizes")
        told = [part for part in self.differences if any(one.what == ATTRIBUTE for one in part.aspects)]
        if told:
            yield self._number_of(told, "attributes")
        others = [part for part in self.differences if part.offset is not None]
        if others:
            yield f"{_count(len(others), 'other file')}"
        for side, names in (("A", self.only_a), ("B", self.only_b)):
            if names:
                yield f"{_count(len(names), 'file')} only in {side}"

    def _number_of(self, parts: Sequence[Difference], what: str) -> str:
        if self.single:
            return what
        sweeps = sum(part.cells is not None for part in parts)
        files = [_count(len(parts) - sweeps, "file")] if len(parts) > sweeps else []
        shards = [f"the shards of {_count(sweeps, 'sweep')}"] if sweeps else []
        return f"{what} in {' and '.join(files + shards)}"

    def _origins(self) -> Iterator[str]:
        """Yield what made the files, where it differs: it explains the rest."""
        for what, names in ORIGINS.items():
            found: dict[str, Aspect] = {}
            files = 0
            for part in self.differences:
                here = [one for one in part.aspects if _is_of(one, names)]
                files += bool(here)
                found = {one.name: one for one in here} | found
            for digest in [name for name in found if name.endswith("_digest") and _explained(name, found)]:
                del found[digest]
            if found:
                told = [f"{one.name} {_against(one.a, one.b)}" for one in list(found.values())[:SHOWN]]
                where = "" if self.single else f" ({_count(files, 'file')})"
                yield f"{what}{where}: {'; '.join(told)}"

    def as_json(self) -> str:
        """Return all of it as JSON."""
        content = {
            "same": self.same,
            "numbers_same": self.numbers_same,
            "verdict": self.verdict,
            "files": self.files,
            "identical": self.identical,
            "only_a": self.only_a,
            "only_b": self.only_b,
            "left_out": self.left_out,
            "notes": self.notes,
            "differences": [asdict(part) for part in self.differences],
        }
        return json.dumps(_finite(content), indent=2)


def _explained(digest: str, found: Mapping[str, Aspect]) -> bool:
    """Return whether what a digest is of is told, too."""
    of = digest.removesuffix("_digest")
    return any(name == of or name.startswith(f"{of}.") for name in found)


def _finite(content: Any) -> Any:
    """Return the same with text for the numbers that JSON does not have."""
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_finite(value) for value in content]
    return repr(content) if isinstance(content, float) and content - content != 0 else content


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _more(number: int, what: str) -> list[str]:
    return [f"… and {number} more {what}"] if number > 0 else []


def _up_to(parts: Sequence[Difference]) -> str:
    """Return the largest difference of floats in all files."""
    ulp = max((values.ulp.size for part in parts for values in part.values if values.ulp), default=None)
    share = max((values.relative.size for part in parts for values in part.values if values.relative), default=0.0)
    return "" if ulp is None else f" (up to {_many(ulp)} ulp, {share:.2g} of the value)"


def _many(number: float) -> str:
    """Return a whole number as people read it."""
    return str(number) if number < 1_000_000 else f"{number:.2g}"


def _only(side: str, names: Sequence[str]) -> Iterator[str]:
    if names:
        yield ""
        yield f"only in {side}:"
        yield from (f"  {name}" for name in names[:SHOWN])
        yield from (f"  {line}" for line in _more(len(names) - SHOWN, "files"))


def _by_folder(names: Sequence[str]) -> str:
    """Return how many side files there are of each kind: `41 of logs, 2 of figures, report.html`."""
    kinds: dict[str, int] = {}
    for name in names:
        *above, last = name.split("/")
        kind = next((part for part in above if part in SIDE_FOLDERS), above[-1] if above else "")
        hidden = any(part.startswith(".") for part in (*above, last))
        kind = "hidden" if hidden else last if last in SIDE_FILES else f"of {kind}"
        kinds[kind] = kinds.get(kind, 0) + 1
    return ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))


def _about(part: Difference, shown: int) -> Iterator[str]:
    """Yield how the files of one name differ, line by line, so many variables and attributes of each."""
    yield from part.unreadable
    if part.cells is not None:
        yield from _about_cells(part.cells)
    if part.since:
        yield f"the same before {part.since}"
    for values in part.values[:shown]:
        yield from _about_values(values)
    yield from _more(len(part.values) - shown, "variables")
    alike: dict[tuple[str, str, Plain | None, Plain | None], list[str]] = {}
    for one in part.aspects:
        if not any(_is_of(one, names) for names in ORIGINS.values()):
            alike.setdefault((one.what, one.name, one.a, one.b), []).append(one.variable)
    # What only one of the two says is often only newer.
    for aspect, variables in sorted(alike.items(), key=lambda item: None in item[0][2:])[:shown]:
        yield _about_aspect(*aspect, variables)
    yield from _more(len(alike) - shown, "of these")
    if part.line is not None:
        number, a, b = part.line
        yield f"from line {number} on:"
        yield f"  A: {_short(a)}"
        yield f"  B: {_short(b)}"
    elif part.offset is not None:
        yield f"from byte {part.offset} on"
    yield from part.notes


def _about_cells(cells: Cells) -> Iterator[str]:
    yield f"{cells.differing} of the {_count(cells.same + cells.differing, 'cell')} in both differ"
    for side, names in (("A", cells.only_a), ("B", cells.only_b)):
        if names:
            yield f"only in {side}: {_count(len(names), 'cell')}, {names[0]}" + (", …" if len(names) > 1 else "")


def _about_values(values: Values) -> Iterator[str]:
    kinds = [
        f"{count} {what}"
        for count, what in (
            (values.one_nan, "NaN in one only"),
            (values.one_infinite, "infinite in one only"),
            (values.signs, "by the sign of zero only"),
        )
        if count
    ]
    size = _size_of(values)
    name = values.variable
    if values.of == 1 and values.first is not None:
        yield f"{name}: {_pair(values.first)}" + (f", {size}" if size else "") + (", 0 ulp" if values.signs else "")
        return
    count = f"{values.count} of {_count(values.of, 'value')} {'differs' if values.count == 1 else 'differ'}"
    yield f"{name}: {count}" + (f", by up to {size}" if size else "") + (f" ({', '.join(kinds)})" if kinds else "")
    for titles, place in _places(values):
        yield f"  {titles} at {place.where} [{', '.join(map(str, place.index))}]: {_pair(place)}"


def _pair(place: Place) -> str:
    return f"{_short(place.a)} against {_short(place.b)}"


def _units(values: Values) -> str:
    return "" if values.units == "1" else values.units


def _size_of(values: Values) -> str:
    """Return the largest differences: `3 ulp, 4.1e-16 of the value, 2.2e-16 m`."""
    parts = []
    if values.ulp is not None:
        parts.append(f"{_many(values.ulp.size)} ulp")
    if values.relative is not None:
        parts.append(f"{values.relative.size:.2g} of the value")
    if values.absolute is not None and (values.ulp is not None or values.of > 1):
        size = values.absolute.size
        parts.append(f"{f'{size:.2g}' if isinstance(size, float) else _many(size)} {_units(values)}".rstrip())
    return ", ".join(parts)


def _places(values: Values) -> list[tuple[str, Place]]:
    """Return the places worth showing, each with what it is."""
    if values.first is None:
        return []
    found = {_key(values.first): (["first"], values.first)}
    absolutely = f"in {_units(values)}" if _units(values) else "absolutely"
    extremes = {"in ulp": values.ulp, "of the value": values.relative, absolutely: values.absolute}
    largest = {what: extreme.place for what, extreme in extremes.items() if extreme is not None}
    if len({_key(place) for place in largest.values()}) == 1:
        largest = {"": next(iter(largest.values()))}
    for what, place in largest.items():
        found.setdefault(_key(place), ([], place))[0].append(f"most {what}".rstrip())
    return [(" and ".join(titles), place) for titles, place in found.values()]


def _key(place: Place) -> tuple[str, tuple[int, ...]]:
    return place.where, place.index


def _about_aspect(what: str, name: str, a: Plain | None, b: Plain | None, variables: Sequence[str]) -> str:
    some = ", ".join(variables[:3]) + (f" and {len(variables) - 3} more" if variables[3:] else "")
    if what == VARIABLE:
        side, dimensions = ("B", b) if a is None else ("A", a)
        return f"{some}: only in {side}, {dimensions or 'one value'}"
    if what == ATTRIBUTE:
        return f"{some}: {name} {_against(a, b)}" if some else f"{name}: {_against(a, b)}"
    word = "sizes" if what == DIMENSIONS else what
    return f"{some}: {word} {_against(a or 'one value', b or 'one value')}"


def _is_of(one: Aspect, names: Sequence[str]) -> bool:
    """Return whether files differ in one of these attributes; what only one of them says explains nothing."""
    if one.what != ATTRIBUTE or one.variable or one.a is None or one.b is None:
        return False
    attribute = one.name.split(".")[0]
    return any(attribute == name or attribute.endswith(f"_{name}") for name in names)


_DIGEST = re.compile(r"…?[0-9a-f]{40,}")
_WIDE = 40  # characters of a text that are shown


def _against(a: Plain | None, b: Plain | None) -> str:
    """Return two values shortly; of long texts what is about where they begin to differ."""
    left, right = (_plain_text(value) for value in (a, b))
    if a is None or b is None:
        return f"only in {'B' if a is None else 'A'}: {_short(right if a is None else left)}"
    start = next((k for k, pair in enumerate(zip(left, right, strict=False)) if pair[0] != pair[1]), 0)
    if start > _WIDE // 2:
        left, right = (f"…{text[start - _WIDE // 4 :]}" for text in (left, right))
    return f"{_short(left)} against {_short(right)}"


def _plain_text(value: Plain | None) -> str:
    return value if isinstance(value, str) else repr(value)


def _short(text: str) -> str:
    shown = f"{text[:8]}…" if _DIGEST.fullmatch(text) else text
    return shown if len(shown) <= _WIDE else f"{shown[: _WIDE - 1]}…"
