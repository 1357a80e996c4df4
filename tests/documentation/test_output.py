"""What is compared of a command's output, and what is left to the machine."""

from __future__ import annotations

import pytest
from tests.documentation.output import difference

SHOWN = "ground    S = 294000 kg/s², landing at t = 0.2 s\nrun time  about 200 µs, measured on this machine\n"
ADVICE = """\
  event             600      1e-05      3.5×10⁻⁶   200 µs  × 1        measured
  rk4               124,800             5.1×10⁻⁵   42 ms   × 210      measured
  velocity_verlet   249,600             1.7×10⁻⁴   16 ms   × 83       measured
"""


def test_times_of_the_machine_and_the_width_of_columns_do_not_count():
    assert not difference(SHOWN, SHOWN.replace("200 µs", "1.1 ms"))
    for multiple in ("4.5×10⁴", "10⁴"):
        assert not difference(ADVICE, ADVICE.replace("42 ms   × 210 ", f"9 ms  × {multiple}"))
    assert not difference(ADVICE, "".join(sorted(ADVICE.splitlines(keepends=True), reverse=True)))
    for roundoff in ("1.1e-15", "3.2×10⁻¹⁵", "10⁻¹⁵"):
        assert not difference("defect -2.30516e-14 J\n", f"defect {roundoff} J\n")


@pytest.mark.parametrize(
    ("old", "new"), [("294000", "294001"), ("t = 0.2 s", "t = 0.3 s"), ("ground", "Ground"), ("\n", "\nmore\n")]
)
def test_all_else_counts(old, new):
    assert difference(SHOWN, SHOWN.replace(old, new, 1))
    assert difference(SHOWN.replace(old, new, 1), SHOWN)


def test_the_error_and_the_steps_of_a_scheme_count():
    assert difference(ADVICE, ADVICE.replace("124,800", "124,801"))
    assert difference(ADVICE, ADVICE.replace("5.1×10⁻⁵", "5.2×10⁻⁵"))


def test_dots_stand_for_any_lines_and_for_anything_within_one():
    assert not difference("first\n...\nlast\n", "first\nsecond\nthird\nlast\n")
    assert not difference("first\n...\nlast\n", "first\nlast\n")
    assert not difference("first: ... files\n", "first: 457 files\n")
    assert difference("first\n...\nlast\n", "first\nsecond\n")
