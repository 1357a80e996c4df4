"""What a terminal obeys is shown, not sent."""

from __future__ import annotations

from pathlib import Path

import pytest

from stiffdice.errors import InputError, printable
from stiffdice.io.reader import open_file
from stiffdice.report import file_page

NEWEST = Path(__file__).parent / "reference" / "formats" / "1.3"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("ωh = 2, ½ as far; 9 µm", "ωh = 2, ½ as far; 9 µm"),
        ("\x1b[2Jgone", r"\x1b[2Jgone"),
        ("two\nlines\r\t", r"two\nlines\r\t"),
        ("a\u202eb\u2066c\u200fd", r"a\u202eb\u2066c\u200fd"),
        ("\x9b31m\u2028\udcff\0", r"\x9b31m\u2028\udcff\x00"),
    ],
)
def test_text_from_elsewhere_is_shown_on_one_line(text, shown):
    assert printable(text) == shown == printable(shown)
    assert str(InputError(text)) == shown


def test_what_a_file_says_of_itself_is_shown_on_its_own_lines():
    run = open_file(NEWEST / "run.h5")
    lines = file_page.as_text(run, "run.h5").split("\n")
    evil = "good\nverdict\n  passed\u202e\x1b[1A"
    run.attrs |= {"title": evil, evil: evil}
    run.position.attrs["long_name"] = evil
    told = file_page.as_text(run, f"\x1b[2J{evil}").split("\n")
    assert len(told) == len(lines) + 1
    assert all(line.isprintable() for line in told)
