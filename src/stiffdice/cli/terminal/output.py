"""What commands print: text with colours where a terminal shows it, notes unless they are to be quiet, JSON."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterable
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, TextIO

from stiffdice.errors import printable

if TYPE_CHECKING:
    from stiffdice.simulation.outcome import Verdict

RED, GREEN, YELLOW = "31", "32", "33"

# Whether progress and notes are left out (--quiet).
QUIET: ContextVar[bool] = ContextVar("QUIET", default=False)

# Words of a verdict, by where they stand on a line; the groups named `good`, `bad` and `doubtful` are coloured.
_VERDICTS = re.compile(
    r"(?:^|.*?: )(?:(?P<good>passed(?=:)|nothing wrong(?=;))|(?P<bad>\d+ of \d+ contacts with something wrong))"
    r"|^(?P<failing>FAILS|DIFFERS)(?=[:,])"
    r"|^(?P<whole>nothing fails|the same(?:,| numbers))|^(?P<different>(?:the numbers are the same; )?different)(?=:)"
    r"|^.* (?P<distrusted>must not be trusted)"
    r"|^  verdict +(?:(?P<fine>fine)$|(?P<wrong>.+))"
    r"|^(?P<failed>failed|interrupted)$"
    r"|^(?P<note>note)(?=: )"
)
_COLOURS = {
    **dict.fromkeys(("good", "whole", "fine"), GREEN),
    **dict.fromkeys(("bad", "failing", "different", "distrusted", "wrong", "failed"), RED),
    "note": YELLOW,
}


def is_coloured(stream: TextIO | None) -> bool:
    """Return whether colours go to a stream: to a terminal that has them, unless NO_COLOR or FORCE_COLOR says so."""
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return os.environ.get("TERM") != "dumb" and stream is not None and stream.isatty()


def painted(text: str, colour: str, stream: TextIO | None) -> str:
    """Return text in a colour, where the stream shows it."""
    return f"\x1b[{colour}m{text}\x1b[0m" if text and is_coloured(stream) else text


def say(text: str | Iterable[str]) -> None:
    """Print a page, or lines of it, with the words of verdicts in colour."""
    lines = text.split("\n") if isinstance(text, str) else text
    print("\n".join(_in_colour(line) for line in lines))


def say_verdict(lines: list[str], name: str, verdict: Verdict) -> None:
    """Print how a run ended, `NAME: passed: ...` and what that rests on, the verdict's words in colour."""
    words, colour = verdict.sentence.partition(":")[0], RED if verdict else GREEN
    first = lines[0].removeprefix(f"{name}: {words}")
    print(f"{printable(name)}: {painted(words, colour, sys.stdout)}{printable(first)}")
    for line in lines[1:]:
        print(printable(line))


def note(lines: Iterable[str]) -> None:
    """Print notes on standard error, a line each."""
    for line in lines if not QUIET.get() else ():
        print(f"stiffdice: {painted('note', YELLOW, sys.stderr)}: {printable(line)}", file=sys.stderr)


def say_json(data: Any) -> None:
    """Print data as one JSON object; raises ValueError for a number that JSON does not have."""
    print(json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False))


def _in_colour(line: str) -> str:
    found = _VERDICTS.match(line) if is_coloured(sys.stdout) else None
    if found is None:
        return line
    name = next(name for name, text in found.groupdict().items() if text is not None)
    start, end = found.span(name)
    return f"{line[:start]}{painted(line[start:end], _COLOURS[name], sys.stdout)}{line[end:]}"
