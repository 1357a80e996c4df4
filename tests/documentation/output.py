"""Compares what a page shows of a command's output with what it printed, but for what the machine decides."""

from __future__ import annotations

import difflib
import re

_NUMBER = r"[\d.,]+(?:(?:×10)?[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+|e[+-]?\d+)?"
_TIME = rf"{_NUMBER} (?:ns|µs|ms|s|min|h|days|years)\b"
# What differs from one machine, day or run to another.
NORMALISATIONS = [
    (r"(?m)^compiling .*\n", ""),  # the first time
    (rf"{_TIME}\s+×\s*{_NUMBER}", "TIME"),  # `advise`: of a scheme, and as a multiple of the best one's
    (rf"{_TIME}(?=\s+(?:measured|predicted|estimated)\b)", "TIME"),
    (rf"\b(about|in|after|for|took|now,|left on \d+ cores?,) {_TIME}", r"\1 TIME"),
    (rf"{_NUMBER} ?[kMG]?B\b", "SIZE"),
    (r"\b\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(Z| UTC)?", "DATE"),
    (r"\b[0-9a-f]{12,64}\b", "DIGEST"),
    (r"\bprocess \d+ on \S+", "PROCESS"),
    (r"\b(mujoco|drake|dart|pybullet) \d+\.\d+(\.\d+)?", r"\1 VERSION"),
    # Round-off, which follows the processor's instructions.
    (r"[-+−]?\d(\.\d+)?e-(0[89]|[1-9]\d)\b", "ROUNDOFF"),
    (r"[-+−]?(?:\d(\.\d+)?×)?10⁻(?:[⁸⁹]|[¹²³]\S)", "ROUNDOFF"),
    (r"(?m)[ \t]+$", ""),
    (r"(?<=\S) {2,}", " "),  # columns are as wide as their numbers
]
ANYTHING = ("...", "…")


def _by_name(rows: re.Match[str]) -> str:
    return "".join(sorted(rows[0].splitlines(keepends=True)))


def normalised(text: str) -> str:
    """Return a text without what the machine decides."""
    for pattern, instead in NORMALISATIONS:
        text = re.sub(pattern, instead, text)
    # `advise` sorts schemes by their time.
    row = r"^ +(?:> )?(?:event|exact|\w+_(?:euler|verlet)|rk4) .*\bTIME\b.*\n"
    return re.sub(rf"(?m)(?:{row})+", _by_name, text.strip("\n") + "\n")


def difference(shown: str, printed: str) -> str:
    """Return how what was printed differs from what is shown; empty where it does not.

    A shown line of three dots stands for any lines, three dots within one for anything there.
    """
    expected, found = normalised(shown), normalised(printed)
    parts = [
        "(?:.*\n)*" if line in ANYTHING else re.escape(line).replace(re.escape("..."), ".*") + "\n"
        for line in expected.splitlines()
    ]
    if re.fullmatch("".join(parts), found):
        return ""
    return "\n".join(difflib.unified_diff(expected.splitlines(), found.splitlines(), "shown", "printed", lineterm=""))
