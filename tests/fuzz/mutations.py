"""Ways to spoil bytes and text, each the same for the same seed."""

from __future__ import annotations

import random
import re

# What numbers and words of a text are turned into.
NUMBERS = (
    *("nan", ".nan", "inf", ".inf", "-.inf", "1e999", "-1e999", "-0", "-0.0", "0", "-1", "1e-320", "1.0e308", "2**60"),
    *("9" * 30, "1" + "0" * 400, "9" * 5000, "0x10", "010", "1_000", "1:30:00", "1e", "0.1.2", "+", "9007199254740993"),
    *(
        "true",
        "yes",
        "~",
        "",
        "'1'",
        '"1"',
        "[]",
        "{}",
        "[1, 2, 3]",
        "{a: 1}",
        "2001-01-01",
        "2001-12-14t21:59:43.10-05:00",
    ),
)
TAGS = (
    *(
        "!!python/object/apply:os.system ['true'] ",
        "!!python/name:os.system ",
        "!!python/tuple ",
        "!!binary ",
        "!!set ",
    ),
    *("!!timestamp ", "!!int ", "!!float ", "!!bool ", "!!null ", "!!str ", "!!omap ", "!!pairs ", "!local ", "!!map "),
    *(
        "!!merge ",
        "!!value ",
        "!<tag:yaml.org,2002:int> ",
        "&a ",
        "*a ",
        "<<: *a",
        "&a [*a]",
        "? ",
        "- ",
        "| ",
        "> ",
        "%YAML 9.9\n",
    ),
)
MARKS = (
    *(
        "\t",
        "\r",
        "\0",
        "\x1b[31m",
        "\ufeff",
        "\u2028",
        "\x85",
        "\xa0",
        "\ud7ff",
        "\U0001f3b2",
        "\u202e",
        "---\n",
        "...\n",
    ),
    *(
        "{",
        "}",
        "[",
        "]",
        ":",
        ",",
        "#",
        "&",
        "*",
        "!",
        "|",
        ">",
        "'",
        '"',
        "%",
        "@",
        "`",
        "\\",
        "=",
        "<<",
        "  ",
        "\n",
        "..",
    ),
)
LAUGHS = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{chr(98 + k)}: &{chr(98 + k)} [{', '.join([f'*{chr(97 + k)}'] * 9)}]\n" for k in range(12)
)
MERGES = "a: &a {x: 1}\n" + "".join(
    f"{chr(98 + k)}: &{chr(98 + k)} {{<<: [{', '.join([f'*{chr(97 + k)}'] * 9)}]}}\n" for k in range(12)
)
BOMBS = (
    *("[" * 3000, "{a: " * 3000, "- " * 3000, "a:\n" + " " * 900, "? " * 3000, "!" * 5000, "'" * 9999, "x" * 200_000),
    *(LAUGHS, MERGES, "&a [*a]", "&a {a: *a}", "a: &a\n  <<: *a\n", "&a {<<: *a}", "? &a [1]\n: *a\n"),
)
_NUMBER = re.compile(r"[-+]?[0-9][0-9.eE+-]*")
_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*")

_WORDS = [0, 1, 7, 2**31, 2**32 - 1, 2**60, 2**63 - 1, 2**63, 2**64 - 1, 2**64 - 8]  # of 8 bytes, where sizes are


def bytes_of(data: bytes, others: list[bytes], seed: int) -> bytes:
    """Return `data` with a few changes that know nothing of what it is."""
    chance = random.Random(seed)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 8))):
        data = chance.choice((_flipped, _overwritten, _inserted, _cut, _shortened, _swapped, _repeated, _spliced))(
            data, others, chance
        )
    return data


def _place(data: bytes, chance: random.Random) -> tuple[int, int]:
    """Return where a stretch starts and ends, mostly a short one."""
    start = chance.randrange(len(data) + 1)
    return start, min(len(data), start + chance.choice((1, 2, 4, 8, 16, 64, 512, 4096)))


def _flipped(data: bytes, _: list[bytes], chance: random.Random) -> bytes:
    if not data:
        return data
    place = chance.randrange(len(data))
    return data[:place] + bytes([data[place] ^ 1 << chance.randrange(8)]) + data[place + 1 :]


def _overwritten(data: bytes, _: list[bytes], chance: random.Random) -> bytes:
    start, end = _place(data, chance)
    new = chance.choice(_WORDS).to_bytes(8, "little") if chance.random() < 0.5 else chance.randbytes(end - start)
    return data[:start] + new + data[start + len(new) :]


def _inserted(data: bytes, _: list[bytes], chance: random.Random) -> bytes:
    start, end = _place(data, chance)
    return data[:start] + chance.choice((chance.randbytes(end - start), bytes(end - start))) + data[start:]


def _cut(data: bytes, _: list[bytes], chance: random.Random) -> bytes:
    start, end = _place(data, chance)
    return data[:start] + data[end:]


def _shortened(data: bytes, _: list[bytes], chance: random.Random) -> bytes:
    return data[: chance.randrange(len(data) + 1)]


def _swapped(data: bytes, _: list[bytes], chance: random.Random) -> bytes:
    (a, b), (c, d) = sorted((_place(data, chance), _place(data, chance)))
    return data if b > c else data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]


def _repeated(data: bytes, _: list[bytes], chance: random.Random) -> bytes:
    start, end = _place(data, chance)
    return data[:end] + data[start:end] * chance.choice((1, 2, 50)) + data[end:]


def _spliced(data: bytes, others: list[bytes], chance: random.Random) -> bytes:
    other = chance.choice(others)
    start, end = _place(other, chance)
    place, _ = _place(data, chance)
    return data[:place] + other[start : chance.choice((end, len(other)))]


def text_of(data: bytes, others: list[bytes], seed: int) -> bytes:
    """Return a text with a few changes that know YAML and JSON, now and then with some that know nothing."""
    chance = random.Random(seed)
    if chance.random() < 0.25:
        return bytes_of(data, others, seed)
    text = data.decode("utf-8", "replace")
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        change = chance.choice((_renumbered, _renumbered, _renumbered, _reworded, _tagged, _marked, _lines, _bombed))
        text = change(text, others, chance)
    data = text.encode("utf-8", "surrogatepass")
    return chance.choice((b"\xef\xbb\xbf", b"\xff\xfe")) + data if chance.random() < 0.02 else data


def _renumbered(text: str, _: list[bytes], chance: random.Random) -> str:
    found = list(_NUMBER.finditer(text))
    if not found:
        return text
    number = chance.choice(found)
    return text[: number.start()] + chance.choice(NUMBERS) + text[number.end() :]


def _reworded(text: str, others: list[bytes], chance: random.Random) -> str:
    found = list(_WORD.finditer(text))
    if not found:
        return text
    word = chance.choice(found)
    elsewhere = _WORD.findall(chance.choice(others).decode("utf-8", "replace")) or ["x"]
    new = chance.choice(
        (chance.choice(found)[0], chance.choice(elsewhere), chance.choice(NUMBERS), word[0][:-1], "<<", "x")
    )
    return text[: word.start()] + new + text[word.end() :]


def _tagged(text: str, _: list[bytes], chance: random.Random) -> str:
    found = [*_NUMBER.finditer(text), *_WORD.finditer(text)]
    place = chance.choice(found).start() if found else 0
    return text[:place] + chance.choice(TAGS) + text[place:]


def _marked(text: str, _: list[bytes], chance: random.Random) -> str:
    place = chance.randrange(len(text) + 1)
    return text[:place] + chance.choice(MARKS) + text[place + chance.randrange(2) :]


def _lines(text: str, others: list[bytes], chance: random.Random) -> str:
    """Take a line out, say one twice, indent one, or take one from elsewhere."""
    lines = text.splitlines(keepends=True) or [""]
    place = chance.randrange(len(lines))
    elsewhere = chance.choice(others).decode("utf-8", "replace").splitlines(keepends=True) or [""]
    lines[place : place + 1] = chance.choice(
        (
            [],
            [lines[place]] * 2,
            [" " + lines[place]],
            [lines[place], chance.choice(elsewhere)],
            [chance.choice(elsewhere)],
        )
    )
    return "".join(lines)


def _bombed(text: str, _: list[bytes], chance: random.Random) -> str:
    bomb = chance.choice(BOMBS)
    place = chance.choice((0, len(text), text.find(":") + 1, text.find("\n") + 1))
    return text[:place] + chance.choice(("", " ", "\n")) + bomb + text[place:]
